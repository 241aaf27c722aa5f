#include "surfels/generated/recipe_surfel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "core/surfel_normal.h"
#include "surfels/generated/scene_generator.h"

namespace surfeit {
namespace {

// Recipes are a few lines long.
constexpr std::size_t kMaxRecipeBytes = 64 << 10;

// Nothing is in a row, and nobody reads it. It is as wide as a surfel, so that who sizes batches by
// the bytes of rows gets batches of the usual size; memory that is not written to costs nothing.
constexpr std::size_t kRowBytes = sizeof(Surfel);

class RecipeSurfelSource : public SurfelSource {
 public:
  RecipeSurfelSource(std::string path, SceneGenerator generator)
      : path_(std::move(path)), generator_(std::move(generator)) {}

  const std::string& path() const override { return path_; }
  std::uint64_t recordCount() const override { return generator_.recordCount(); }
  CloudChannels channels() const override { return generator_.channels(); }
  UpAxis up() const override { return kGeneratedUpAxis; }
  void setOrigin(const glm::dvec3& origin) override { origin_ = origin; }
  const SurfelDefects& defects() const override { return defects_; }
  std::size_t rowBytes() const override { return kRowBytes; }
  bool isSeekable() const override { return true; }

  Result<std::size_t> read(std::span<Surfel> surfels) override {
    const std::size_t count = takeRecords(surfels.size());
    make(next_record_ - count, surfels.first(count));
    return count;
  }

  Status rewind() override {
    next_record_ = 0;
    return {};
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    const std::size_t count = takeRecords(max_rows);
    buffer.reserve(count * kRowBytes);
    return Bytes(buffer.data(), count * kRowBytes);
  }

  Result<std::size_t> decodeRows(Bytes rows, std::uint64_t first_record, std::span<Surfel> surfels,
                                 SurfelDefects&) const override {
    const std::size_t count = rows.size() / kRowBytes;
    make(first_record, surfels.first(count));
    return count;
  }

  Status seekRow(std::uint64_t record) override {
    if (record > recordCount()) {
      return Status::invalidArgument(
          fmt::format("{}: record {}: expected at most {}", path_, record, recordCount()));
    }
    next_record_ = record;
    return {};
  }

 private:
  // Moves on by up to `count` records; returns by how many.
  std::size_t takeRecords(std::size_t count) {
    const std::uint64_t taken = std::min<std::uint64_t>(count, recordCount() - next_record_);
    next_record_ += taken;
    return static_cast<std::size_t>(taken);
  }

  // The surfels as they would be read from a file, where normals are made unit length once more.
  void make(std::uint64_t first_record, std::span<Surfel> surfels) const {
    generator_.generate(first_record, surfels);
    for (Surfel& surfel : surfels) {
      const glm::vec3 normal = surfel.normal;
      normalise(double(normal.x), double(normal.y), double(normal.z), surfel.normal);
      surfel.position = glm::vec3(glm::dvec3(surfel.position) - origin_);
    }
  }

  std::string path_;
  SceneGenerator generator_;
  SurfelDefects defects_;  // there are none
  std::uint64_t next_record_ = 0;
  glm::dvec3 origin_{0};
};

}  // namespace

Result<std::unique_ptr<SurfelSource>> openRecipeSource(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  if (file.size() > kMaxRecipeBytes) {
    return Status::corruption(fmt::format("{}: found {} bytes, expected a recipe of at most {}",
                                          path, file.size(), kMaxRecipeBytes));
  }
  std::vector<std::byte> text(static_cast<std::size_t>(file.size()));
  SURFEIT_RETURN_IF_ERROR(file.readAt(0, text));
  SURFEIT_ASSIGN_OR_RETURN(
      const SceneRecipe recipe,
      parseSceneRecipe(std::string_view(reinterpret_cast<const char*>(text.data()), text.size()),
                       path));
  SURFEIT_ASSIGN_OR_RETURN(SceneGenerator generator, SceneGenerator::create(recipe));
  return std::unique_ptr<SurfelSource>(
      std::make_unique<RecipeSurfelSource>(path, std::move(generator)));
}

}  // namespace surfeit
