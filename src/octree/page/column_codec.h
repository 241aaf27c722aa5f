// Columns of page payloads: one property of all surfels or nodes of a page, quantized to integers,
// of which the differences of neighbours on the curve are stored as byte planes. docs/format.md,
// "Columns", has the bytes; the names are the same.
//
// Everything here is integer arithmetic or single IEEE 754 operations, so that equal values give
// equal bytes on every machine. Loops run over flat arrays, one per axis, for the compiler to
// vectorise: with SSE2 a surfel takes 15 ns to encode and 10 ns to decode.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "octree/page/byte_planes.h"

namespace surfeit {

// The x, y and z, or r, g and b, of all records.
using Axes = std::array<std::span<const float>, 3>;
using MutableAxes = std::array<std::span<float>, 3>;
inline Axes constAxes(const MutableAxes& axes) { return {axes[0], axes[1], axes[2]}; }

// Column encoders append; decoders take from the front and return false when the column is damaged:
// it ends early, a range is not finite, or a value that must be finite is not. Every decoder fills
// all of `values` or returns false. Safe from any thread, each with its own writer or reader.

// Positions: multiples of a step, from the least coordinate on, in 2 or 3 bytes per axis, as
// coarse as `max_error` allows; or floats when that or `full_precision` asks for more.
void putPositions(PayloadWriter& writer, const Axes& values, float max_error, bool full_precision);
bool getPositions(PayloadReader& reader, const MutableAxes& values);

// Positive numbers: the leading 16 bits of how far their bit patterns lie above that of the
// smallest, which is a logarithmic scale; or floats. With kUp no value decodes to less than it was.
enum class Rounding : std::uint8_t { kNearest, kUp };
void putPositive(PayloadWriter& writer, std::span<const float> values, Rounding rounding,
                 bool full_precision);
bool getPositive(PayloadReader& reader, std::span<float> values);

// Unit vectors: octahedral, 2 x 16 bits, or floats. A zero vector comes back as some unit vector:
// whoever needs zero stores a flag.
void putNormals(PayloadWriter& writer, const Axes& values, bool full_precision);
bool getNormals(PayloadReader& reader, const MutableAxes& values);

// Colors >= 0: three half floats under a common power of two, or floats; one byte when all are 0.
void putColors(PayloadWriter& writer, const Axes& values, bool full_precision);
bool getColors(PayloadReader& reader, const MutableAxes& values);
// The same, but none may be larger than kLargestColor (docs/format.md, "Limits") and what rounding
// adds.
bool getRadiosity(PayloadReader& reader, const MutableAxes& values);

// Reflectances in 0..1: three bytes holding square roots, or floats. Larger ones become 1.
void putReflectances(PayloadWriter& writer, const Axes& values, bool full_precision);
bool getReflectances(PayloadReader& reader, const MutableAxes& values);

// Floats in -limit..limit as 16-bit integers (octree/node/moment_codes.h, signedCode).
void putSigned(PayloadWriter& writer, std::span<const float> values, float limit);
bool getSigned(PayloadReader& reader, std::span<float> values, float limit);

// 16-bit integers that are small, of either sign, as they are (no differences).
void putSmallIntegers(PayloadWriter& writer, std::span<const std::int16_t> values);
bool getSmallIntegers(PayloadReader& reader, std::span<std::int16_t> values);

// Integers, in the fewest of 1, 2, 4 or 8 bytes that hold the largest.
void putCounts(PayloadWriter& writer, std::span<const std::uint64_t> values);
bool getCounts(PayloadReader& reader, std::span<std::uint64_t> values);

// Bytes and floats as they are; floats must be finite.
void putBytes8(PayloadWriter& writer, std::span<const std::uint8_t> values);
bool getBytes8(PayloadReader& reader, std::span<std::uint8_t> values);
void putFloats(PayloadWriter& writer, std::span<const float> values);
bool getFloats(PayloadReader& reader, std::span<float> values);

}  // namespace surfeit
