#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "core/job_limits.h"
#include "io/page_file_damage.h"
#include "io/page_file_fixture.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// Files with holes declare more than they store. Offsets of the parts behind the hole move.
class SparseFileTest : public PageFileTest {
 protected:
  // `file` with `hole` bytes of zeros put in at `at`, its footer and checksums made right.
  void writeSparse(std::string file, std::size_t at, std::uint64_t hole) {
    const std::size_t footer = footerAt(file);
    for (const std::size_t field : {kProvenanceOffsetAt, kDirectoryOffsetAt, kFileBytesAt}) {
      const std::uint64_t offset = getAt<std::uint64_t>(file, footer + field);
      if (offset > at) setAt(file, footer + field, offset + hole);
    }
    setAt(file, footer + kFooterChecksumAt,
          hashOf(file, footer, footer + kFooterChecksumAt, getAt<std::uint64_t>(file, 16)));
    replaceContents(path("sparse.sft"), file.substr(0, at));
    std::filesystem::resize_file(path("sparse.sft"), at + hole);
    std::ofstream(path("sparse.sft"), std::ios::binary | std::ios::app) << file.substr(at);
  }

  // A hole of as many bytes amid the pages, and then one in the directory.
  void writeSparseTwice(std::uint64_t hole) {
    std::string file = sample();
    const std::uint64_t pages_end = fieldOf(file, kProvenanceOffsetAt);
    writeSparse(file, pages_end - 1, hole);
    std::ifstream in(path("sparse.sft"), std::ios::binary);
    in.seekg(-static_cast<std::streamoff>(kFooterBytes), std::ios::end);
    std::string footer(kFooterBytes, '\0');
    in.read(footer.data(), static_cast<std::streamsize>(footer.size()));
    in.close();
    setAt(footer, kFileBytesAt, getAt<std::uint64_t>(footer, kFileBytesAt) + hole);
    setAt(footer, kFooterChecksumAt,
          XXH3_64bits_withSeed(footer.data(), kFooterChecksumAt, getAt<std::uint64_t>(file, 16)));
    const std::uint64_t size = std::filesystem::file_size(path("sparse.sft"));
    std::filesystem::resize_file(path("sparse.sft"),
                                 getAt<std::uint64_t>(footer, kDirectoryOffsetAt));
    std::filesystem::resize_file(path("sparse.sft"), size + hole - kFooterBytes);
    std::ofstream(path("sparse.sft"), std::ios::binary | std::ios::app) << footer;
  }

  void expectRefused(const std::string& what) {
    const std::uint64_t peak_before = peakResidentBytes();
    const Result<PageFile> pages = PageFile::open(path("sparse.sft"));
    EXPECT_EQ(pages.status().code(), StatusCode::kCorruption);
    EXPECT_THAT(pages.status().message(), AllOf(HasSubstr("sparse.sft: "), HasSubstr(what)));
    EXPECT_LT(peakResidentBytes(), peak_before + (std::uint64_t{1} << 20));
  }

  std::uint64_t fieldOf(const std::string& file, FooterField field) {
    return getAt<std::uint64_t>(file, footerAt(file) + field);
  }
};

TEST_F(SparseFileTest, ProvenanceOfAHoleIsRefusedBeforeItIsRead) {
  const std::string file = sample();
  writeSparse(file, fieldOf(file, kDirectoryOffsetAt) - 1, std::uint64_t{1} << 30);
  expectRefused("expected at most 65536");
}

TEST_F(SparseFileTest, DirectoryOfAHoleIsRefusedBeforeItTakesMemory) {
  const std::string file = sample();
  for (const std::uint64_t entries : {std::uint64_t{100'000'000}, (std::uint64_t{1} << 32) - 100}) {
    writeSparse(file, footerAt(file), entries * kEntryBytes);
    expectRefused("expected at most");
    writeSparse(file, fieldOf(file, kDirectoryOffsetAt), entries * kEntryBytes);
    expectRefused("expected at most");
  }
}

// The address space of this process, while it lives.
class LimitedAddressSpace {
 public:
  explicit LimitedAddressSpace(std::uint64_t bytes) {
    EXPECT_EQ(::getrlimit(RLIMIT_AS, &before_), 0);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    EXPECT_EQ(::setrlimit(RLIMIT_AS, &limit), 0);
  }
  LimitedAddressSpace(const LimitedAddressSpace&) = delete;
  LimitedAddressSpace& operator=(const LimitedAddressSpace&) = delete;
  ~LimitedAddressSpace() { ::setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_;
};

std::uint64_t addressSpaceBytes() {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// Room for it is not even asked for: a limit of the address space does not matter.
TEST_F(SparseFileTest, DirectoryOfAHoleIsRefusedHoweverManyBytesThePagesHave) {
  writeSparseTwice(100'000'000 * kEntryBytes);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const LimitedAddressSpace limit(addressSpaceBytes() + (std::uint64_t{1} << 30));
#endif
  expectRefused("page 0 at 0");
}

TEST_F(SparseFileTest, MorePagesThanHaveNumbersAreRefused) {
  writeSparseTwice((std::uint64_t{1} << 32) * kEntryBytes);
  expectRefused("is no whole number of entries");
}

}  // namespace
}  // namespace surfeit
