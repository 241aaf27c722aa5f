#include "io/surfel_writer.h"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <set>
#include <string>
#include <utility>

#include "core/long_side.h"
#include "io/cloud_formats.h"
#include "io/surfel_names.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowBufferBytes = 256 << 10;

}  // namespace

struct SurfelWriter::State {
  std::unique_ptr<RowWriter> file;
  CloudChannels channels;
  std::vector<std::byte> rows;
  std::string path;
  Progress* progress = nullptr;
  std::set<std::string> told;  // notes of the file

  // What the file has not said yet.
  void note() {
    if (progress == nullptr) return;
    for (const std::string& line : file->notes()) {
      if (told.insert(line).second) progress->note(path + ": " + line);
    }
  }
};

Result<SurfelWriter> SurfelWriter::create(const std::string& path, const CloudChannels& channels,
                                          RowWriterOptions options) {
  // The order here is the order in which write packs the values
  options.properties.clear();
  const auto add = [&](const char* name, PlyType type) {
    PlyProperty property;
    property.name = name;
    property.type = type;
    options.properties.push_back(std::move(property));
  };
  const auto addTriple = [&](const char* const(&names)[3]) {
    for (const char* name : names) add(name, PlyType::kFloat32);
  };
  addTriple(kPositionNames);
  if (channels.normal) addTriple(kNormalNames);
  if (channels.radius) add("radius", PlyType::kFloat32);
  if (channels.area) add("area", PlyType::kFloat32);
  if (channels.radiosity) addTriple(kRadiosityNames);
  if (channels.albedo) addTriple(kAlbedoNames);
  if (channels.two_sided) add("two_sided", PlyType::kUint8);
  if (channels.group) add(kGroupNames[0], PlyType::kUint8);
  if (channels.long_side) addTriple(kLongSideNames);

  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowWriter> file, createRowWriter(path, options));
  SurfelWriter writer(
      std::make_unique<State>(State{std::move(file), channels, {}, path, options.progress, {}}));
  writer.state_->note();
  return writer;
}

SurfelWriter::SurfelWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SurfelWriter::SurfelWriter(SurfelWriter&&) noexcept = default;
SurfelWriter& SurfelWriter::operator=(SurfelWriter&&) noexcept = default;
SurfelWriter::~SurfelWriter() = default;

Status SurfelWriter::write(std::span<const Surfel> surfels) {
  const CloudChannels& channels = state_->channels;
  const std::size_t row_bytes = state_->file->element().row_bytes;
  state_->rows.resize(kRowBufferBytes / row_bytes * row_bytes);
  std::byte* const begin = state_->rows.data();
  std::byte* const end = begin + state_->rows.size();
  std::byte* next = begin;
  const auto put = [&](const auto& value) {
    std::memcpy(next, &value, sizeof value);
    next += sizeof value;
  };
  for (const Surfel& surfel : surfels) {
    put(surfel.position);
    if (channels.normal) put(surfel.normal);
    if (channels.radius) put(surfel.radius);
    if (channels.area) put(surfel.area);
    if (channels.radiosity) put(surfel.radiosity);
    if (channels.albedo) put(surfel.albedo);
    if (channels.two_sided) put(static_cast<std::uint8_t>(surfel.isTwoSided()));
    if (channels.group) put(surfel.group);
    if (channels.long_side) put(longSideOf(surfel));

    // Hand over a full buffer, and the last
    if (next == end || &surfel == &surfels.back()) {
      const std::size_t size = static_cast<std::size_t>(next - begin);
      SURFEIT_RETURN_IF_ERROR(state_->file->writeRows(std::span(state_->rows).first(size)));
      next = begin;
    }
  }
  return {};
}

Status SurfelWriter::finish() {
  SURFEIT_RETURN_IF_ERROR(state_->file->finish());
  state_->note();
  return {};
}

}  // namespace surfeit
