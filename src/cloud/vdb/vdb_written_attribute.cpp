#include "cloud/vdb/vdb_written_attribute.h"

#include <cstring>

#include "cloud/vdb/vdb_writers.h"

namespace surfeit {
namespace {

std::string attributeName(std::string_view channel) {
  struct Name {
    std::string_view channel, attribute;
  };
  constexpr Name kNames[] = {{"position", "P"}, {"normal", "N"},   {"radius", "pscale"},
                             {"color", "Cd"},   {"velocity", "v"}, {"id", "id"}};
  for (const Name& name : kNames) {
    if (name.channel == channel) return std::string(name.attribute);
  }
  return vdbName(channel);
}

}  // namespace

VdbWrittenAttribute vdbWrittenAttribute(const RowChannel& channel, const RowLayout& element) {
  VdbWrittenAttribute attribute;
  attribute.channel = channel;
  attribute.name = attributeName(channel.name);
  const char *scalar = "float", *vector = "vec3s", *matrix = "mat4s";
  const auto use = [&](VdbWrittenAttribute::Kind kind, std::size_t bytes, const char* scalar_type,
                       const char* vector_type) {
    attribute.kind = kind;
    attribute.component_bytes = bytes;
    scalar = scalar_type;
    vector = vector_type;
    matrix = nullptr;
  };
  using Kind = VdbWrittenAttribute::Kind;
  if (channel.name == "position") {
    attribute.kind = Kind::kPosition;
  } else if (isCodedColor(channel)) {
    attribute.kind = Kind::kFloat;
  } else {
    switch (channel.type) {
      case ValueType::kInt8:
      case ValueType::kUint8:
      case ValueType::kInt16:
        use(Kind::kInt16, 2, "int16", nullptr);
        break;
      case ValueType::kUint16:
      case ValueType::kInt32:
        use(Kind::kInt32, 4, "int32", "vec3i");
        break;
      case ValueType::kUint32:
        use(Kind::kInt64, 8, "int64", nullptr);
        break;
      case ValueType::kFloat64:
        use(Kind::kCopy, 8, "double", "vec3d");
        matrix = "mat4d";
        break;
      case ValueType::kFloat32:
        break;
    }
  }
  // Where the properties of a channel differ in type they meet in the widest real one
  for (const std::size_t index : channel.properties) {
    const ValueType type = element.properties[index].type;
    if (attribute.kind == Kind::kCopy && type != channel.type) {
      use(Kind::kFloat, 4, "float", "vec3s");
      matrix = "mat4s";
    }
  }
  const std::size_t components = channel.properties.size();
  attribute.value_type = scalar;
  if (components == 3 && vector != nullptr) {
    attribute.value_type = vector;
  } else if (components == 16 && matrix != nullptr) {
    attribute.value_type = matrix;
  } else {
    attribute.stride = static_cast<std::uint32_t>(components);
  }
  return attribute;
}

void encodeVdbPoint(const VdbWrittenAttribute& attribute, const RowLayout& element,
                    const std::byte* row, std::byte* out) {
  using Kind = VdbWrittenAttribute::Kind;
  const RowChannel& channel = attribute.channel;
  const auto put = [&](auto value) {
    std::memcpy(out, &value, sizeof(value));
    out += sizeof(value);
  };
  for (std::size_t component = 0; component < channel.properties.size(); ++component) {
    if (attribute.kind == Kind::kCopy) {
      const RowProperty& property = element.properties[channel.properties[component]];
      std::memcpy(out, row + property.offset, attribute.component_bytes);
      out += attribute.component_bytes;
      continue;
    }
    const double value = channelValue(element, channel, component, row);
    switch (attribute.kind) {
      case Kind::kInt16:
        put(static_cast<std::int16_t>(value));
        break;
      case Kind::kInt32:
        put(static_cast<std::int32_t>(value));
        break;
      case Kind::kInt64:
        put(static_cast<std::int64_t>(value));
        break;
      default:
        put(static_cast<float>(value));
    }
  }
}

}  // namespace surfeit
