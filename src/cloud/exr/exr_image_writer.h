// An OpenEXR picture written scan line by scan line: one part, scan lines, ZIP compression. Takes a
// few scan lines of memory. What writes pictures of its own (cloud/exr/exr_writer.h, the view)
// stands on it.
#pragma once

#include <OpenEXR/ImfForward.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

enum class ExrPixelType : std::uint8_t { kHalf, kFloat, kUint };

struct ExrImageChannel {
  std::string name;
  ExrPixelType type = ExrPixelType::kFloat;
};

// The header of a picture like that of `part`: its windows, pixel aspect and attributes, but for
// those that say how the part was stored (channels, what R G B shows, compression, tiles, name,
// preview, ...).
Imf::Header exrHeaderLike(const Imf::Header& part);

// One thread at a time. The file appears under its name only when finish() succeeds; destroyed
// before that, the writer leaves nothing.
class ExrImageWriter {
 public:
  // `header` gives windows and attributes, its channels are ignored. kInvalidArgument when two
  // channels have one name, or one has none.
  static Result<std::unique_ptr<ExrImageWriter>> create(const std::string& path,
                                                        const Imf::Header& header,
                                                        std::vector<ExrImageChannel> channels);
  virtual ~ExrImageWriter() = default;

  // Pixels of the data window.
  virtual std::size_t width() const = 0;
  virtual std::size_t height() const = 0;

  // The values of a channel in the scan line that writeLine() writes next, 0 at first: those of
  // half and float channels, and those of kUint. Halves are rounded to the nearest finite one.
  virtual std::span<float> floats(std::size_t channel) = 0;
  virtual std::span<std::uint32_t> integers(std::size_t channel) = 0;

  // Writes the next scan line, the top one first; height() times. The values stay as they are.
  virtual Status writeLine() = 0;
  virtual Status finish() = 0;
};

}  // namespace surfeit
