// Records of a cloud that hold no valid surfel: how many, where, why, and the way out.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace surfeit {

// Records that hold no valid surfel, by kind, each with the number of the first (from 0).
struct SurfelDefects {
  struct Kind {
    std::uint64_t count = 0;
    std::uint64_t first_record = 0;
    // Of the first record: the property that is bad, a name that lasts, and its value
    const char* property = "";
    double value = 0;
    std::string drops = {};  // what --channels takes to drop it; empty: a surfel has it

    // Counts a record.
    void add(std::uint64_t record, const char* bad_property = "", double bad_value = 0,
             const std::string& drops_of_property = {});
    // "3 records with a non-finite value (first: record 17, whose y is nan)"
    std::string describe(const char* what) const;
  };
  Kind non_finite;      // a NaN or infinity in any property that is used
  Kind bad_radius;      // radius zero or negative, where the cloud has radii
  Kind bad_area;        // area zero or negative, where the cloud has areas
  Kind short_normal;    // a normal that is not zero (a sphere) but too short (< 1e-6) to point
  Kind negative_color;  // negative radiosity or albedo
  Kind out_of_range;    // beyond kLargestLength, kLargestArea or kLargestColor
  Kind bad_group;       // group that is no whole number from 0 to 63, where the cloud has groups
  Kind bad_opacity;     // opacity that is 0 or less (nothing is there), or above 1

  std::uint64_t total() const;
  // Number of the first record with any defect. Only when total() is not 0.
  std::uint64_t firstRecord() const;
  // Takes in the defects of another part of the same file. In any order the sum is the same.
  void add(const SurfelDefects& other);
  // "3 records with a non-finite value (first: record 17, whose y is nan), ..."; empty when total()
  // is 0.
  std::string describeKinds() const;
  // "; --channels normal=- reads ...": how to read such records without their bad properties;
  // empty where properties are not known.
  std::string wayOut() const;
  // Both.
  std::string describe() const { return describeKinds() + wayOut(); }
};

// The channel that --channels drops, so that records are read without a property that is bad;
// empty: none, for a surfel has a place.
std::string_view channelToDrop(std::string_view property);

}  // namespace surfeit
