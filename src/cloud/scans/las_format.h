// The header of a LAS file (ASPRS): what stands where, the records of variable length behind it,
// and what they say of extra bytes and of the coordinates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/scans/las_values.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::string_view kLasMagic = "LASF";

// Sizes of the header by version, and where things stand in it.
inline constexpr std::size_t kLasHeaderBytes12 = 227, kLasHeaderBytes13 = 235,
                             kLasHeaderBytes14 = 375, kLasHeaderBytes15 = 393;
struct LasHeaderPlaces {
  static constexpr std::size_t kEncoding = 6, kVersion = 24, kSystem = 26, kSoftware = 58,
                               kDay = 90, kYear = 92, kHeaderSize = 94, kDataOffset = 96,
                               kRecordCount = 100, kPointFormat = 104, kRecordBytes = 105,
                               kCount = 107, kReturns = 111, kScale = 131, kOrigin = 155,
                               kBounds = 179, kWaveforms = 227, kExtendedOffset = 235,
                               kExtendedCount = 243, kCount64 = 247, kReturns64 = 255,
                               kTimeOffset = 391;
};
inline constexpr std::uint16_t kLasInternalWaveforms = 2, kLasExternalWaveforms = 4,
                               kLasWellKnownText = 16;

// A record of variable length begins with two bytes, the user's name, a number and the length of
// its data; 16 bits where it stands before the points, 64 behind them.
inline constexpr std::size_t kLasRecordHeader = 54, kLasExtendedHeader = 60;
inline constexpr std::string_view kLasSpecUser = "LASF_Spec",
                                  kLasProjectionUser = "LASF_Projection";
inline constexpr std::uint16_t kLasExtraBytesRecord = 4, kLasWktRecord = 2112,
                               kLasGeoKeysRecord = 34735, kLasGeoTextRecord = 34737;
inline constexpr std::size_t kLasDescriptorBytes = 192;
// What extra bytes are called that have no name.
inline constexpr std::string_view kLasExtraBytes = "extra_bytes";

// Text that a zero ends, unless it fills its place.
inline std::string lasTextOf(Bytes bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return std::string(text.substr(0, text.find('\0')));
}

// A header that was read, and what is needed to write one like it.
struct LasHeader {
  std::string path;
  std::vector<std::byte> bytes;  // as it stands, without what stands behind the version's fields
  unsigned minor = 0, point_format = 0;
  std::uint64_t count = 0;  // points that are read
  std::uint64_t data_offset = 0;
  std::uint64_t header_size = 0;  // as stated
  std::size_t record_bytes = 0;
  std::array<double, 3> scale{}, origin{};
  std::uint32_t variable_count = 0, extended_count = 0;
  std::uint64_t extended_offset = 0;
  std::vector<std::byte> descriptors;  // of extra bytes, kLasDescriptorBytes each
  std::vector<std::string> crs;        // "crs PROJCS[...]", "crs EPSG:2992"
  std::vector<std::string> notes;

  // Everything of a record, extra bytes among it; those that nothing describes are one field
  // extra_bytes. `notes` gets what of the description is wrong.
  std::vector<LasField> fields(std::vector<std::string>* notes) const;
};

// Reads and checks the header and the records that say how points are to be read, and finds out how
// many there are: a count that is too small is corrected and told. kCorruption names the byte.
Result<LasHeader> readLasHeader(ByteInput& input);

// The records that a header and its like stand for: their user, number and data, one by one. Those
// before the points, then those behind them.
struct LasRecord {
  std::string user;
  std::uint16_t number = 0;
  bool is_extended = false;
  std::uint64_t offset = 0, bytes = 0;  // of all of it, with its own header
};
// Of damaged ones as many as are there; `is_whole` tells whether these are all.
Result<std::vector<LasRecord>> findLasRecords(ByteInput& input, const LasHeader& header,
                                              bool& is_whole);

}  // namespace surfeit
