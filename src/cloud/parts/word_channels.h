// What writers of formats with nothing but words of 32 bits (BGEO, PDB) share: reals are stored as
// float32, integers as int32.
#pragma once

#include <string>
#include <vector>

#include "cloud/parts/channel_encoder.h"

namespace surfeit {

inline bool isReal(const RowChannel& channel) {
  return isFloatType(channel.type) || isCodedColor(channel);
}

// Stores `channel` as words; what they cannot keep is told in `notes`.
inline ChannelEncoder wordEncoder(const RowLayout& element, const RowChannel& channel,
                                  std::vector<std::string>& notes) {
  if (isCodedColor(channel)) {
    notes.push_back("integers that code sRGB become linear float32: " + channel.name);
  } else if (channel.type == ValueType::kFloat64) {
    notes.push_back("float64 becomes float32: " + channel.name);
  } else if (channel.type == ValueType::kUint32) {
    notes.push_back("integers from 2^31 up become negative: " + channel.name);
  }
  return {element, channel, isReal(channel) ? ValueType::kFloat32 : ValueType::kInt32};
}

}  // namespace surfeit
