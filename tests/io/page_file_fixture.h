// A directory for page files, with small ones to damage.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/test_directory.h"
#include "storage/page_codec.h"
#include "storage/page_file.h"

namespace surfeit {

inline constexpr std::uint64_t kFileIdentity = 0x0123456789abcdefull;
inline const std::string kProvenance = "{\"program\":\"test\"}";

// A payload that depends on its number, compressible like real ones.
inline std::vector<std::byte> payloadOf(std::uint32_t number) {
  std::vector<std::byte> payload(100 + 37 * (number % 5));
  std::uint32_t state = number * 2654435761u + 1;
  for (std::size_t i = 0; i < payload.size(); ++i) {
    state = state * 1664525 + 1013904223;
    payload[i] = static_cast<std::byte>(i % 4 == 0 ? state >> 24 : i / 8);
  }
  return payload;
}

inline std::vector<std::byte> sceneFields() {
  std::vector<std::byte> fields(kSceneFieldsBytes);
  for (std::size_t i = 0; i < fields.size(); ++i) fields[i] = static_cast<std::byte>(i * 7);
  return fields;
}

class PageFileTest : public DirectoryTest {
 protected:
  // Surfel pages hold payloads 100.., node pages 0..
  void writePages(const std::string& name, std::uint32_t node_pages, std::uint32_t surfel_pages,
                  std::uint64_t identity = kFileIdentity) {
    Result<PageFileWriter> writer = PageFileWriter::create(path(name), identity);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    std::vector<std::byte> stored;
    for (std::uint32_t i = 0; i < surfel_pages; ++i) {
      ASSERT_TRUE(compressPage(payloadOf(100 + i), stored).ok());
      ASSERT_TRUE(writer->addSurfelPage(stored, std::uint32_t(payloadOf(100 + i).size())).ok());
    }
    for (std::uint32_t i = 0; i < node_pages; ++i) {
      ASSERT_TRUE(compressPage(payloadOf(i), stored).ok());
      ASSERT_TRUE(writer->addNodePage(stored, std::uint32_t(payloadOf(i).size())).ok());
    }
    EXPECT_LE(fileCount(), 1) << "a temporary file at most";
    ASSERT_TRUE(writer->finish(sceneFields(), kProvenance).ok());
    EXPECT_EQ(writer->fileBytes(), contents(name).size());
  }

  // Opens the file and reads every page.
  Status readAll(const std::string& name, Access access = Access::kCached) {
    SURFEIT_ASSIGN_OR_RETURN(const PageFile pages, PageFile::open(path(name), access));
    AlignedBuffer stored;
    std::vector<std::byte> payload;
    for (std::uint32_t page = 0; page < pages.pageCount(); ++page) {
      SURFEIT_RETURN_IF_ERROR(pages.readPage(page, stored, payload));
    }
    return {};
  }

  // Whether reading `bytes` as a file fails as damage does, naming the file.
  testing::AssertionResult noticed(const std::string& bytes) {
    replaceContents(path("damaged.sft"), bytes);
    const Status status = readAll("damaged.sft");
    if (const Status direct = readAll("damaged.sft", Access::kDirect);
        direct.message() != status.message()) {
      return testing::AssertionFailure() << "read directly: " << direct.message();
    }
    if (status.ok()) return testing::AssertionFailure() << "not noticed";
    if (status.code() != StatusCode::kCorruption ||
        status.message().find("damaged.sft: ") == std::string::npos) {
      return testing::AssertionFailure() << status.message();
    }
    return testing::AssertionSuccess();
  }

  // A small file to damage.
  std::string sample() {
    writePages("sample.sft", 2, 3);
    return contents("sample.sft");
  }
};

}  // namespace surfeit
