// Pixar's point clouds (.ptc), header versions 0, 1 and 2: a header, then records of one size.
//
//   "pptc", i32 version, f64 points, f32[6] bounds
//   version >= 1: f32[4] of unknown meaning; version >= 2: f32 largest radius, 32 filler words
//   f32[16] world to eye, f32[16] world to screen, f32[3] x and y resolution, pixel aspect
//   i32 variables, i32 floats of all variables
//   a line "type name" for each variable; version >= 1: 8 bytes of unknown meaning
//   records: f32[3] position, u16 phi, u16 z, f32 radius, f32 for each float of the variables
//
// Everything is little-endian.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/channels.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr int kNewestPtcVersion = 2;
// More variables than any renderer writes; keeps the properties of a row few.
inline constexpr std::size_t kMaxPtcVariables = 256;
// Bytes of a record in front of its variables: position, normal, radius.
inline constexpr std::size_t kPtcPointBytes = 20;

// A variable of every record.
struct PtcVariable {
  std::string name;
  ChannelKind kind = ChannelKind::kFloat;

  std::size_t floatCount() const;
};

// The camera that a cloud was made with, as the file has it: matrices by rows.
struct PtcCamera {
  std::array<float, 16> eye_from_world{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::array<float, 16> screen_from_world{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::array<float, 3> format{640, 480, 1};  // x and y resolution, pixel aspect
};

struct PtcHeader {
  int version = 0;
  std::uint64_t count = 0;
  std::array<float, 6> bounds{};  // least x y z, largest x y z; of positions
  float largest_radius = 0;       // version 2
  PtcCamera camera;
  std::vector<PtcVariable> variables;
  std::uint64_t data_offset = 0;  // of the first record

  std::size_t recordBytes() const;
};

bool recognisesPtc(std::string_view first_bytes);

// kCorruption naming the offset, what was found and what was expected.
Result<PtcHeader> readPtcHeader(ByteInput& input);
// The header as it stands in a file. Counts above 2^53 would not be exact: the caller has fewer.
std::vector<std::byte> formatPtcHeader(const PtcHeader& header);

// A normal in a record, and zero: [ z : 16 | phi : 16 ]. The code of a unit vector is off by 0.0014
// degrees in the mean and by up to 0.32 at the poles, where phi runs around a circle of one z.
struct PtcNormal {
  std::uint16_t phi = 65535, z = 65535;  // this is the zero normal
};
// Of a normal of any length but zero, whose values are finite; else that of the zero normal.
PtcNormal encodePtcNormal(const float normal[3]);
void decodePtcNormal(PtcNormal code, float normal[3]);

}  // namespace surfeit
