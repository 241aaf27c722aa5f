// Columns of page payloads: one property of all surfels or nodes of a page, quantized, stored byte
// plane by byte plane (all low bytes, then all next ones), which is what zstd compresses best.
// docs/format.md, "Columns", has the bytes; the names are the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/byte_coding.h"
#include "surfeit/status.h"

namespace surfeit {

// Column encoders append; decoders take from the front and return false when the column is damaged:
// it ends early, a range is not finite, or a value that must be finite is not. Every decoder fills
// all of `values` or returns false.

// Positions: 2 or 3 bytes per axis within the column's box, or floats when `max_error` (or
// `full_precision`) asks for more.
void putPositions(ByteWriter& writer, std::span<const glm::vec3> values, float max_error,
                  bool full_precision);
bool getPositions(ByteReader& reader, std::span<glm::vec3> values);
// Largest distance between a position and its stored form, for values that putPositions would
// store with this max_error.
float positionError(std::span<const glm::vec3> values, float max_error, bool full_precision);

// Positive numbers: 2 bytes on a logarithmic scale between the smallest and the largest, or
// floats. With kUp no value decodes to less than it was.
enum class Rounding : std::uint8_t { kNearest, kUp };
void putPositive(ByteWriter& writer, std::span<const float> values, Rounding rounding,
                 bool full_precision);
bool getPositive(ByteReader& reader, std::span<float> values);

// Unit vectors: octahedral, 2 x 16 bits, or floats. A zero vector comes back as some unit vector:
// whoever needs zero stores a flag.
void putNormals(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision);
bool getNormals(ByteReader& reader, std::span<glm::vec3> values);

// Colors >= 0: three half floats under a common power of two, or floats; one byte when all are 0.
void putColors(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision);
bool getColors(ByteReader& reader, std::span<glm::vec3> values);

// Reflectances in 0..1: three bytes holding square roots, or floats. Larger ones become 1.
void putReflectances(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision);
bool getReflectances(ByteReader& reader, std::span<glm::vec3> values);

// Floats in -limit..limit as 16-bit integers; limit itself is not stored.
void putSigned(ByteWriter& writer, std::span<const float> values, float limit);
bool getSigned(ByteReader& reader, std::span<float> values, float limit);

// Integers, in the fewest of 1, 2, 4 or 8 bytes that hold the largest.
void putCounts(ByteWriter& writer, std::span<const std::uint64_t> values);
bool getCounts(ByteReader& reader, std::span<std::uint64_t> values);

// Bytes and floats as they are; floats must be finite.
void putBytes8(ByteWriter& writer, std::span<const std::uint8_t> values);
bool getBytes8(ByteReader& reader, std::span<std::uint8_t> values);
void putFloats(ByteWriter& writer, std::span<const float> values);
bool getFloats(ByteReader& reader, std::span<float> values);

}  // namespace surfeit
