// What tests of readers of pictures share: a damaged file is read, or refused by its name; nothing
// else happens.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include "io/test_directory.h"
#include "surfeit/status.h"

namespace surfeit {

class PictureFileTest : public DirectoryTest {
 protected:
  // Every beginning of `bytes` shorter than `needed` is refused as damaged. `read` gives the Status
  // of reading all of the file of a name.
  template <typename Read>
  void expectTruncationsAreRefused(const std::string& bytes, std::size_t needed, Read read) const {
    for (std::size_t size = 0; size < needed; ++size) {
      std::filesystem::remove(path("cut"));  // what is written over is flushed
      write("cut", bytes.substr(0, size));
      const Status status = read("cut");
      ASSERT_EQ(status.code(), StatusCode::kCorruption) << size << " of " << bytes.size();
      ASSERT_NE(status.message().find("cut: "), std::string::npos) << size;
    }
  }

  // Whatever a byte is changed to, the file is read, when only a value changed, or refused.
  template <typename Read>
  void expectDamageIsHarmless(const std::string& bytes, Read read) const {
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      for (const int flip : {0x01, 0x80, 0xff}) {
        std::string damaged = bytes;
        damaged[i] = char(damaged[i] ^ flip);
        std::filesystem::remove(path("damaged"));
        write("damaged", damaged);
        const Status status = read("damaged");
        ASSERT_TRUE(status.ok() || status.message().find("damaged: ") != std::string::npos)
            << i << ": " << status.message();
      }
    }
  }
};

// An OpenEXR file with another data window: x and y of its first pixel, x and y of its last.
inline std::string withExrWindow(std::string bytes, const std::array<std::int32_t, 4>& window) {
  const std::size_t at = bytes.find("dataWindow") + 11 + 6 + 4;
  std::memcpy(bytes.data() + at, window.data(), sizeof(window));
  return bytes;
}

}  // namespace surfeit
