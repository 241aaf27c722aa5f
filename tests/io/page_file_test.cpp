#include "storage/page_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "core/job_limits.h"
#include "io/fault_injector.h"
#include "io/page_file_damage.h"
#include "io/page_file_fixture.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

// Fails the test when a read of pages is not as its access says: direct, or exactly the page.
class ReadWatch : public FaultInjector {
 public:
  explicit ReadWatch(Access access) : access_(access) {}
  void expect(const PageEntry& page) {
    page_ = page;
    reads_ = 0;
  }
  int before(CallInfo& info) override {
    if (info.call != Call::kPread) return 0;
    ++reads_;
    const bool is_direct = (::fcntl(info.descriptor, F_GETFL) & O_DIRECT) != 0;
    EXPECT_EQ(is_direct, access_ == Access::kDirect);
    if (access_ == Access::kCached) {
      EXPECT_EQ(info.offset, page_.offset);
      EXPECT_EQ(info.bytes, page_.stored_bytes);
    }
    return 0;
  }
  int reads() const { return reads_; }

 private:
  const Access access_;
  PageEntry page_;
  int reads_ = 0;
};

TEST_F(PageFileTest, PageIsOneReadOfItsBytesOrADirectOne) {
  writePages("a.sft", 40, 300);
  for (const Access access : {Access::kCached, Access::kDirect}) {
    const Result<PageFile> pages = PageFile::open(path("a.sft"), access);
    ASSERT_TRUE(pages.ok()) << pages.status().message();
    ReadWatch watch(access);
    const Faults faults{&watch};
    AlignedBuffer stored;
    std::vector<std::byte> payload;
    for (std::uint32_t i = 0; i < pages->pageCount(); ++i) {
      watch.expect(pages->entry(i));
      ASSERT_TRUE(pages->readPage(i, stored, payload).ok());
      EXPECT_EQ(watch.reads(), 1);
      ASSERT_EQ(payload, payloadOf(i < 40 ? i : 100 + i - 40));
    }
    EXPECT_LE(stored.capacity(), pages->maxStoredBytes() + 2 * kDirectAlignment);
  }
}

TEST_F(PageFileTest, FailedReadAndCutFileNameFilePageAndPlace) {
  writePages("a.sft", 2, 3);
  for (const Access access : {Access::kCached, Access::kDirect}) {
    const Result<PageFile> pages = PageFile::open(path("a.sft"), access);
    ASSERT_TRUE(pages.ok());
    AlignedBuffer stored;
    std::vector<std::byte> payload;
    const std::string place = " at " + std::to_string(pages->entry(3).offset);
    {
      FailCall fail(1, EIO, FailCall::Repeat::kForEver, only(Call::kPread));
      const Faults faults{&fail};
      const Status status = pages->readPage(3, stored, payload);
      EXPECT_EQ(status.code(), StatusCode::kIoError);
      EXPECT_THAT(status.message(), AllOf(StartsWith(path("a.sft") + ": cannot read "),
                                          EndsWith(": Input/output error (page 3" + place + ")")));
    }
    const std::string file = contents("a.sft");
    std::filesystem::resize_file(path("a.sft"), pages->entry(3).offset + 1);
    const Status status = pages->readPage(3, stored, payload);
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    EXPECT_THAT(status.message(),
                StartsWith(path("a.sft") + ": page 3" + place + ": file ends early: 1 bytes"));
    write("a.sft", file);
  }
}

TEST_F(PageFileTest, WhatIsWrittenIsRead) {
  for (const auto& [node_pages, surfel_pages] :
       {std::pair{0u, 0u}, {1u, 0u}, {0u, 1u}, {3u, 4u}, {40u, 300u}}) {
    writePages("a.sft", node_pages, surfel_pages);
    const Result<PageFile> pages = PageFile::open(path("a.sft"));
    ASSERT_TRUE(pages.ok()) << pages.status().message();
    EXPECT_EQ(pages->identity(), kFileIdentity);
    EXPECT_EQ(pages->provenance(), kProvenance);
    EXPECT_EQ(pages->fileBytes(), contents("a.sft").size());
    EXPECT_EQ(std::vector<std::byte>(pages->sceneFields().begin(), pages->sceneFields().end()),
              sceneFields());
    ASSERT_EQ(pages->nodePageCount(), node_pages);
    ASSERT_EQ(pages->pageCount(), node_pages + surfel_pages);
    AlignedBuffer stored;
    std::vector<std::byte> payload;
    for (std::uint32_t i = 0; i < pages->pageCount(); ++i) {
      ASSERT_TRUE(pages->readPage(i, stored, payload).ok());
      ASSERT_EQ(payload, payloadOf(i < node_pages ? i : 100 + i - node_pages));
      EXPECT_LE(stored.capacity(), pages->maxStoredBytes() + 2 * kDirectAlignment);
      EXPECT_LE(payload.size(), pages->maxPayloadBytes());
    }
    std::filesystem::remove(path("a.sft"));
  }
}

TEST_F(PageFileTest, UnfinishedFileLeavesNothing) {
  {
    Result<PageFileWriter> writer = PageFileWriter::create(path("a.sft"), kFileIdentity);
    ASSERT_TRUE(writer.ok());
    std::vector<std::byte> stored;
    ASSERT_TRUE(compressPage(payloadOf(1), stored).ok());
    ASSERT_TRUE(writer->addSurfelPage(stored, std::uint32_t(payloadOf(1).size())).ok());
  }
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(PageFileTest, EveryTruncationIsNoticed) {
  const std::string file = sample();
  for (std::size_t size = 0; size < file.size(); ++size) {
    ASSERT_TRUE(noticed(file.substr(0, size))) << size << " bytes";
  }
}

TEST_F(PageFileTest, EveryFlippedBitIsNoticed) {
  std::string file = sample();
  for (std::size_t at = 0; at < file.size(); ++at) {
    const char right = file[at];
    for (int bit = 0; bit <= 8; ++bit) {
      file[at] = static_cast<char>(right ^ (bit == 8 ? 0xff : 1 << bit));
      ASSERT_TRUE(noticed(file)) << "byte " << at << ", bit " << bit;
    }
    file[at] = right;
  }
}

TEST_F(PageFileTest, AppendedBytesAreNoticed) {
  const std::string file = sample();
  for (const std::size_t size : {1, 511, 4096, 1 << 20}) {
    EXPECT_TRUE(noticed(file + std::string(size, '\0'))) << size;
    EXPECT_TRUE(noticed(file + std::string(size, '\xff'))) << size;
  }
  // Even when what is appended ends like a file
  EXPECT_TRUE(noticed(file + file));
  EXPECT_TRUE(noticed(file + file.substr(footerAt(file))));
}

TEST_F(PageFileTest, EveryWipedSectorIsNoticed) {
  writePages("big.sft", 20, 100);
  const std::string file = contents("big.sft");
  ASSERT_GT(file.size(), 3u * 4096);
  for (const std::size_t sector : {512u, 4096u}) {
    for (const char fill : {'\0', '\xff'}) {
      for (std::size_t at = 0; at < file.size(); at += sector) {
        std::string damaged = file;
        const std::size_t size = std::min(sector, file.size() - at);
        damaged.replace(at, size, size, fill);
        ASSERT_TRUE(noticed(damaged)) << sector << " bytes at " << at;
      }
    }
  }
}

TEST_F(PageFileTest, SwappedPagesAreNoticed) {
  writePages("big.sft", 20, 100);
  const std::string file = contents("big.sft");
  const Result<PageFile> pages = PageFile::open(path("big.sft"));
  ASSERT_TRUE(pages.ok());
  int swaps = 0;
  for (std::uint32_t a = 0; a < pages->pageCount() && swaps < 300; ++a) {
    for (std::uint32_t b = a + 1; b < pages->pageCount(); ++b) {
      const PageEntry& first = pages->entry(a);
      const PageEntry& second = pages->entry(b);
      if (first.stored_bytes != second.stored_bytes) continue;
      std::string damaged = file;
      damaged.replace(first.offset, first.stored_bytes, file, second.offset, second.stored_bytes);
      damaged.replace(second.offset, second.stored_bytes, file, first.offset, first.stored_bytes);
      ASSERT_TRUE(noticed(damaged)) << "pages " << a << " and " << b;
      ++swaps;
    }
  }
  EXPECT_GT(swaps, 100);
}

TEST_F(PageFileTest, PageOfAnotherFileAtTheSameOffsetIsNoticed) {
  writePages("a.sft", 2, 3);
  const std::string a = contents("a.sft");
  std::filesystem::remove(path("a.sft"));
  writePages("b.sft", 2, 3, kFileIdentity + 1);
  const std::string b = contents("b.sft");
  ASSERT_EQ(a.size(), b.size());
  // The pages are the same bytes; parts that hold checksums are not
  EXPECT_EQ(a.substr(512, 200), b.substr(512, 200));
  EXPECT_TRUE(noticed(b.substr(0, 512) + a.substr(512)));
  EXPECT_TRUE(noticed(a.substr(0, footerAt(a)) + b.substr(footerAt(b))));
  const Result<PageFile> pages = PageFile::open(path("b.sft"));
  ASSERT_TRUE(pages.ok());
  const PageEntry& first = pages->entry(2);
  EXPECT_NE(first.checksum, XXH3_64bits_withSeed(a.data() + first.offset, first.stored_bytes,
                                                 pageSeed(kFileIdentity, first.offset)));
}

TEST_F(PageFileTest, DamageInOnePageLeavesTheOthersReadable) {
  std::string file = sample();
  file[600] ^= 1;
  write("damaged.sft", file);
  const Result<PageFile> pages = PageFile::open(path("damaged.sft"));
  ASSERT_TRUE(pages.ok());
  AlignedBuffer stored;
  std::vector<std::byte> payload;
  for (std::uint32_t page = 0; page < pages->pageCount(); ++page) {
    const PageEntry& at = pages->entry(page);
    const bool damaged = at.offset <= 600 && 600 < at.offset + at.stored_bytes;
    const Status status = pages->readPage(page, stored, payload);
    EXPECT_EQ(status.ok(), !damaged);
    if (!damaged) continue;
    EXPECT_THAT(status.message(), HasSubstr("damaged.sft: page " + std::to_string(page) + " at " +
                                            std::to_string(at.offset) + ": checksum "));
  }
}

TEST_F(PageFileTest, NewerVersionIsRefusedWithItsNumber) {
  for (const std::uint32_t version : {0u, kFormatVersion + 1, 0xffffffffu}) {
    std::string file = sample();
    setAt(file, 8, version);
    sealFile(file);
    write("damaged.sft", file);
    const Result<PageFile> pages = PageFile::open(path("damaged.sft"));
    ASSERT_FALSE(pages.ok());
    EXPECT_THAT(pages.status().message(), HasSubstr("version " + std::to_string(version)));
    EXPECT_THAT(pages.status().message(), HasSubstr("up to " + std::to_string(kFormatVersion)));
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
}

TEST_F(PageFileTest, SealedFileIsReadable) {
  const std::string file = sample();
  std::string sealed = file;
  sealFile(sealed);
  EXPECT_EQ(file, sealed);
}

TEST_F(PageFileTest, HostileFieldsWithValidChecksumsDoNoHarm) {
  const std::string file = sample();
  const std::size_t footer = footerAt(file);
  const std::size_t directory = getAt<std::uint64_t>(file, footer + kDirectoryOffsetAt);
  struct Field {
    std::size_t at;
    std::size_t bytes;
  };
  std::vector<Field> fields = {{8, 4}, {12, 4}, {16, 8}};
  for (std::size_t at = 0; at < kFooterChecksumAt; at += 8) {
    // How many of the pages are node pages the scene header tells too, and decodeSceneHeader
    // compares
    constexpr std::size_t kNodePagesAt = 40;
    if (at != kNodePagesAt) fields.push_back({footer + at, 8});
  }
  for (std::size_t entry = directory; entry < footer; entry += kEntryBytes) {
    fields.push_back({entry, 8});
    fields.push_back({entry + 8, 4});
    fields.push_back({entry + 12, 4});
    fields.push_back({entry + 16, 8});
  }
  const std::uint64_t peak_before = peakResidentBytes();
  const auto start = std::chrono::steady_clock::now();
  int cases = 0;
  for (const Field& field : fields) {
    const std::uint64_t right = field.bytes == 4 ? getAt<std::uint32_t>(file, field.at)
                                                 : getAt<std::uint64_t>(file, field.at);
    for (const std::uint64_t value : hostileValues(right)) {
      if (field.bytes == 4 && value > 0xffffffff) continue;
      std::string damaged = file;
      std::memcpy(damaged.data() + field.at, &value, field.bytes);
      sealFile(damaged);
      // The checksums that sealFile sets are not hostile then; 0 and n are met again as they are
      if (damaged == file) continue;
      // The container of an older version is the same: what its pages hold tells
      if (field.at == 8 && value > 0 && value < kFormatVersion) continue;
      EXPECT_TRUE(noticed(damaged)) << "field at " << field.at << ": " << value;
      ++cases;
    }
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_GT(cases, 150);
  EXPECT_LT(seconds.count() / cases, 0.01);
  // Nothing declared makes the reader allocate: 4 MiB is the largest payload of a page
  EXPECT_LT(peakResidentBytes(), peak_before + (std::uint64_t{16} << 20));
}

// Not by what follows from it, and not later, at a page.
TEST_F(PageFileTest, EveryWrongFieldIsToldWhenTheFileIsOpened) {
  const std::string file = sample();
  const std::size_t footer = footerAt(file);
  const std::size_t directory = getAt<std::uint64_t>(file, footer + kDirectoryOffsetAt);
  const std::uint64_t pages_end = getAt<std::uint64_t>(file, footer + kProvenanceOffsetAt);
  constexpr std::size_t kStored = 8, kPayload = 12;  // of an entry, behind its offset
  const auto told = [&](const std::function<void(std::string&)>& edit) {
    std::string damaged = file;
    edit(damaged);
    replaceContents(path("wrong.sft"), damaged);
    return PageFile::open(path("wrong.sft")).status().message();
  };
  const auto toldAt = [&](std::size_t at, auto value) {
    return told([&](std::string& damaged) {
      setAt(damaged, at, value);
      sealFile(damaged);
    });
  };
  EXPECT_THAT(told([](std::string& damaged) { damaged.resize(100); }),
              HasSubstr("file ends after 100 bytes"));
  EXPECT_THAT(told([](std::string& damaged) { damaged.resize(520); }),
              HasSubstr("file of 520 bytes, expected at least"));
  EXPECT_THAT(toldAt(8, 0u), HasSubstr("format version 0"));
  EXPECT_THAT(toldAt(12, 513u), HasSubstr("header of 513 bytes"));
  EXPECT_THAT(told([&](std::string& damaged) { damaged[directory + 20] ^= 1; }),
              HasSubstr("directory: checksum"));
  EXPECT_THAT(told([&](std::string& damaged) { damaged[pages_end + 3] ^= 1; }),
              HasSubstr("provenance: checksum"));

  EXPECT_THAT(toldAt(footer + kFileBytesAt, std::uint64_t{file.size() + 1}),
              HasSubstr("expected " + std::to_string(file.size() + 1)));
  EXPECT_THAT(toldAt(footer + kProvenanceOffsetAt, std::uint64_t{511}), HasSubstr("do not fit"));
  EXPECT_THAT(toldAt(footer + kProvenanceOffsetAt, std::uint64_t{directory + 1}),
              HasSubstr("do not fit"));
  EXPECT_THAT(toldAt(footer + kDirectoryOffsetAt, std::uint64_t{footer + 1}),
              HasSubstr("do not fit"));
  EXPECT_THAT(toldAt(footer + kDirectoryOffsetAt, std::uint64_t{directory - 1}),
              HasSubstr("no whole number"));
  EXPECT_THAT(toldAt(footer + kNodePagesAt, std::uint64_t{6}), HasSubstr("6 node pages"));

  EXPECT_THAT(toldAt(directory, std::uint64_t{511}), HasSubstr("expected between"));
  EXPECT_THAT(toldAt(directory, pages_end + 1), HasSubstr("expected between"));
  EXPECT_THAT(toldAt(directory, pages_end - 1), HasSubstr("expected between"));
  EXPECT_THAT(toldAt(directory + kStored, 8u), HasSubstr("expected 9 to"));
  EXPECT_THAT(toldAt(directory + kPayload, 1u), HasSubstr("which decode to 1"));
  EXPECT_THAT(toldAt(directory + kPayload, (4u << 20) + 1), HasSubstr("decodes to 4194305 bytes"));
  EXPECT_THAT(toldAt(directory + kStored, getAt<std::uint32_t>(file, directory + kStored) + 1),
              HasSubstr("pages of"));
}

TEST_F(PageFileTest, LongProvenanceIsNotWritten) {
  Result<PageFileWriter> writer = PageFileWriter::create(path("long.sft"), kFileIdentity);
  ASSERT_TRUE(writer.ok());
  const Status status = writer->finish(sceneFields(), std::string(kMaxProvenanceBytes + 1, ' '));
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << status.message();
  EXPECT_FALSE(std::filesystem::exists(path("long.sft")));
}

TEST_F(PageFileTest, PageIsExactlyOneFrame) {
  const std::vector<std::byte> payload = payloadOf(0);
  std::vector<std::byte> frame, plain(16);
  ASSERT_TRUE(compressPage(payload, frame).ok());
  std::vector<std::byte> skipped = {std::byte{0x50}, std::byte{0x2a}, std::byte{0x4d},
                                    std::byte{0x18}, std::byte{4},    std::byte{0},
                                    std::byte{0},    std::byte{0}};
  skipped.resize(skipped.size() + 4);
  const auto refuses = [&](std::vector<std::byte> stored, std::size_t bytes) {
    std::vector<std::byte> decoded(bytes);
    const Status status = decompressPage(stored, decoded);
    return status.code() == StatusCode::kCorruption;
  };
  std::vector<std::byte> before = skipped, behind = frame, twice = frame;
  before.insert(before.end(), frame.begin(), frame.end());
  behind.insert(behind.end(), skipped.begin(), skipped.end());
  twice.insert(twice.end(), frame.begin(), frame.end());
  EXPECT_FALSE(refuses(frame, payload.size()));
  EXPECT_TRUE(refuses(before, payload.size()));
  EXPECT_TRUE(refuses(behind, payload.size()));
  EXPECT_TRUE(refuses(twice, payload.size()));
  EXPECT_TRUE(refuses(twice, 2 * payload.size()));
  skipped.resize(skipped.size() + 4);
  EXPECT_TRUE(refuses(skipped, 4));  // nothing, and four bytes as they are
}

TEST_F(PageFileTest, WhatIsWrongWithAFrameIsTold) {
  const std::vector<std::byte> payload = payloadOf(0);
  std::vector<std::byte> frame;
  ASSERT_TRUE(compressPage(payload, frame).ok());
  const auto told = [](Bytes stored, std::size_t bytes) {
    std::vector<std::byte> decoded(bytes);
    return std::string(decompressPage(stored, decoded).message());
  };
  ASSERT_EQ(told(frame, payload.size()), "");
  // Its header is cut, or does not say how much it holds (bits 5 to 7 of the descriptor)
  EXPECT_THAT(told(Bytes(frame).first(4), payload.size()), HasSubstr("no frame of known size"));
  std::vector<std::byte> unknown = frame;
  unknown[4] &= std::byte{0x1f};
  EXPECT_THAT(told(unknown, payload.size()), HasSubstr("no frame of known size"));
  // It holds more than the page, or the page more than it and all bytes behind it
  EXPECT_THAT(told(frame, payload.size() - 1), HasSubstr("decoded size"));
  EXPECT_THAT(told(frame, payload.size() + frame.size() + 1), HasSubstr("decoded size"));
  // A wrong block is told in zstd's words
  int refused = 0;
  for (std::size_t at = 5; at < frame.size(); ++at) {
    std::vector<std::byte> wrong = frame;
    wrong[at] ^= std::byte{0x7f};
    const std::string message = told(wrong, payload.size());
    EXPECT_THAT(message, testing::Not(HasSubstr("decoded size 18446744")));
    refused += message.starts_with("zstd: ") ? 1 : 0;
  }
  EXPECT_GT(refused, 0);
}

TEST_F(PageFileTest, PagesThatOverlapDoNotTileTheFile) {
  writePages("big.sft", 20, 100);
  std::string file = contents("big.sft");
  const Result<PageFile> sound = PageFile::open(path("big.sft"));
  ASSERT_TRUE(sound.ok() && sound->checkTiling().ok());
  // A page that is another one, of as many bytes
  const std::size_t directory = getAt<std::uint64_t>(file, footerAt(file) + kDirectoryOffsetAt);
  std::uint32_t other = 1;
  while (sound->entry(other).stored_bytes != sound->entry(0).stored_bytes) ++other;
  file.replace(directory, kEntryBytes, file, directory + other * kEntryBytes, kEntryBytes);
  sealFile(file);
  write("twice.sft", file);
  const Result<PageFile> pages = PageFile::open(path("twice.sft"));
  ASSERT_TRUE(pages.ok()) << pages.status().message();
  EXPECT_THAT(pages->checkTiling().message(), HasSubstr("expected at"));
}

TEST_F(PageFileTest, MissingFileAndDirectoryAreIoErrors) {
  EXPECT_EQ(PageFile::open(path("absent.sft")).status().code(), StatusCode::kIoError);
  EXPECT_EQ(PageFile::open(directory_.string()).status().code(), StatusCode::kIoError);
}

TEST_F(PageFileTest, OtherFilesAreNamedAsSuch) {
  for (const std::string& text : {std::string("ply\nformat"), std::string(5000, 'x')}) {
    write("other.sft", text);
    EXPECT_THAT(PageFile::open(path("other.sft")).status().message(),
                HasSubstr("not a Surfeit scene"));
  }
}

}  // namespace
}  // namespace surfeit
