// Files as OpenEXR reads and writes them, and its exceptions as Status. OpenEXR knows only streams
// that throw; these keep the Status that made them, so that it comes out again unchanged.
#pragma once

#include <OpenEXR/ImfIO.h>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time.
class ExrInputStream final : public Imf::IStream {
 public:
  explicit ExrInputStream(InputFile file);

  bool read(char bytes[], int count) override;
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

  const InputFile& file() const { return file_; }
  // Of a file that ends where OpenEXR reads on, or that the system does not read.
  const Status& status() const { return status_; }
  void clearStatus() { status_ = {}; }

 private:
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes);

  InputFile file_;
  std::uint64_t position_ = 0;
  // The bytes at buffer_begin_: headers are read one byte at a time
  std::vector<std::byte> buffer_;
  std::uint64_t buffer_begin_ = 0;
  Status status_;
};

// One thread at a time. The file appears with commit() alone.
class ExrOutputStream final : public Imf::OStream {
 public:
  explicit ExrOutputStream(AtomicFile file);

  void write(const char bytes[], int count) override;
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  // The first failure of any write.
  const Status& status() const { return status_; }
  Status commit();

 private:
  AtomicFile file_;
  std::uint64_t position_ = 0;
  Status status_;
};

// What OpenEXR says, as part of a message: one line of printable characters.
std::string exrMessage(std::string_view text);

// Runs `work`, which returns a Status and may throw what OpenEXR throws: `code` then, "PATH: PLACE:
// OpenEXR: ...", unless the stream has a better reason.
template <typename Stream, typename Work>
Status guardExr(const Stream& stream, StatusCode code, const std::string& path,
                std::string_view place, const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return Status::failed(path + ": out of memory");
  } catch (const std::exception& error) {
    if (!stream.status().ok()) return stream.status();
    return {code, path + ": " + std::string(place) + ": OpenEXR: " + exrMessage(error.what())};
  }
}

}  // namespace surfeit
