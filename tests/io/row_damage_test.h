// What tests of damaged clouds share: a file is read, or refused as damaged; nothing else happens.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/row_writer.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"

namespace surfeit {

using OpenRows = Result<std::unique_ptr<RowReader>> (*)(const std::string&,
                                                        const RowReaderOptions&);

class RowFileTest : public DirectoryTest {
 protected:
  // kOk when all rows of the file could be read.
  static Status readStatus(OpenRows open, const std::string& file,
                           const RowReaderOptions& options = {}) {
    const Result<std::unique_ptr<RowReader>> reader = open(file, options);
    if (!reader.ok()) return reader.status();
    Status status;
    readAllRows(**reader, 1000, status);
    return status;
  }

  static std::unique_ptr<RowReader> openOk(OpenRows open, const std::string& file,
                                           const RowReaderOptions& options = {}) {
    Result<std::unique_ptr<RowReader>> reader = open(file, options);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return reader.ok() ? std::move(*reader) : nullptr;
  }

  // The message of a file that must be refused, opened or read.
  std::string refusal(OpenRows open, const std::string& bytes) {
    write("refused", bytes);
    const Status status = readStatus(open, path("refused"));
    EXPECT_EQ(status.code(), StatusCode::kCorruption) << status.message();
    return status.message();
  }

  // Every beginning of `bytes` shorter than `least_whole`, or every `step`th, is refused as
  // damaged.
  void expectEveryTruncationFails(OpenRows open, const std::string& bytes, std::size_t least_whole,
                                  std::size_t step = 1) {
    for (std::size_t size = 0; size < least_whole; size += step) {
      write("cut", bytes.substr(0, size));
      const Status status = readStatus(open, path("cut"));
      EXPECT_EQ(status.code(), StatusCode::kCorruption) << size << ": " << status.message();
      EXPECT_NE(status.message().find(path("cut")), std::string::npos) << status.message();
    }
  }

  // Whatever a byte is changed to, the file is read or refused as damaged.
  void expectDamageIsHarmless(OpenRows open, const std::string& bytes, std::size_t step = 1) {
    for (std::size_t at = 0; at < bytes.size(); at += step) {
      for (const int value : {0x00, 0x7F, 0xFF}) {
        std::string damaged = bytes;
        damaged[at] = static_cast<char>(value);
        write("damaged", damaged);
        const Status status = readStatus(open, path("damaged"));
        EXPECT_TRUE(status.ok() || status.code() == StatusCode::kCorruption) << status.message();
      }
    }
  }

  // Rows of random values, and the writer's answer to them, in uneven pieces.
  static std::vector<std::byte> randomRows(const RowLayout& element, std::size_t count) {
    std::mt19937 random(5);
    std::vector<std::byte> rows(count * element.row_bytes);
    for (std::size_t i = 0; i < count; ++i) {
      for (const RowProperty& property : element.properties) {
        visitValueType(property.type, [&](auto type) {
          using T = typename decltype(type)::type;
          const T value = static_cast<T>(static_cast<std::int32_t>(random() % 2000) / 16);
          std::memcpy(&rows[i * element.row_bytes + property.offset], &value, sizeof value);
        });
      }
    }
    return rows;
  }

  static void writeAll(RowWriter& writer, const std::vector<std::byte>& rows) {
    const std::size_t row_bytes = writer.element().row_bytes;
    std::size_t piece = 1;
    for (std::size_t at = 0; at < rows.size(); piece = piece * 3 + 1) {
      const std::size_t size = std::min(rows.size() - at, piece * row_bytes);
      ASSERT_TRUE(writer.writeRows(std::span(rows).subspan(at, size)).ok());
      at += size;
    }
    const Status status = writer.finish();
    ASSERT_TRUE(status.ok()) << status.message();
  }
};

inline const char* const kParticleDirectory = SURFEIT_SHARED_DATA_DIR "/particles";

#define SURFEIT_SKIP_WITHOUT_PARTICLES()                             \
  if (!std::filesystem::exists(kParticleDirectory)) {                \
    GTEST_SKIP() << "no sample particles in " << kParticleDirectory; \
  }

}  // namespace surfeit
