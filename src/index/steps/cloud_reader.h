// Reads all input clouds of the indexer once: one thread fetches records, all decode them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "core/bounds.h"
#include "index/notes/merged_comments.h"
#include "index/notes/mixed_clouds.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// Surfels that are handed out at once: 512 KiB, which the second-level cache holds.
inline constexpr std::size_t kReadBatch = 8192;
// Surfels of a sample, about.
inline constexpr std::size_t kSampleSurfels = 65536;

// What one pass over the inputs finds out. The order of the surfels does not show.
struct CloudTotals {
  Bounds3 bounds;
  std::uint64_t surfels = 0;
  std::uint64_t skipped = 0;
  std::uint64_t content = 0;  // sum of the surfels' hashes
  CloudChannels channels;
  std::uint64_t missing_both = 0, missing_area = 0, missing_radius = 0, spheres = 0;
  std::uint64_t covering = 0;          // surfels that have a coverage instead of an area
  std::uint64_t radius_from_area = 0;  // surfels whose radius needs no neighbours (findsRadius())
  std::uint64_t bright = 0;            // surfels with an albedo above 1
  float largest_albedo = 0;            // of any component
  std::vector<Surfel> sample;          // surfels from all over the inputs

  void add(std::span<const Surfel> surfels);
  void add(const CloudTotals& other);
  // Whether any need neighbours to tell.
  bool missesSizes() const { return missing_both + covering + missing_radius > 0; }
};

// How an input is opened; openCloudSource, unless surfels do not come from files.
using SourceOpener = std::function<Result<std::unique_ptr<SurfelSource>>(
    const std::string& path, bool strict, const RowReaderOptions& reading)>;

class CloudReader {
 public:
  // Opens every input to see that it can be read. `read_bytes`: how much is fetched at once.
  // `reading`: what of the files is read, and under which names; the access is chosen here.
  // `opener`: absent for files.
  static Result<CloudReader> open(const std::vector<std::string>& inputs, bool strict,
                                  std::size_t read_bytes, const RowReaderOptions& reading = {},
                                  const SourceOpener& opener = {});

  // Object groups of all surfels of inputs, by input; absent: the input's own.
  using Groups = std::vector<std::optional<std::uint8_t>>;
  void setGroups(Groups groups) { groups_ = std::move(groups); }

  // Names of groups that the comments of inputs with groups of their own say, by group. Where two
  // inputs differ the first is right, which `notes` then tell. After setGroups.
  std::map<std::uint32_t, std::string> groupNames(std::vector<std::string>& notes) const;

  // Records of all inputs, valid or not, and bytes of the files.
  std::uint64_t recordCount() const { return record_count_; }
  const std::vector<std::uint64_t>& records() const { return records_; }  // by input
  std::uint64_t fileBytes() const { return file_bytes_; }
  // Whether sample() works: all inputs can be read at any place.
  bool isSeekable() const { return is_seekable_; }

  // What positions are counted from (SurfelSource::setOrigin) when they are sampled and read.
  const glm::dvec3& origin() const { return origin_; }
  void setOrigin(const glm::dvec3& origin) { origin_ = origin; }

  // The axis that the inputs say is up; where they disagree that of the first, which notes() tell.
  UpAxis up() const { return up_.value_or(kDefaultUpAxis); }

  // The coordinate reference system of the first input that states one, for the scene to keep;
  // empty where none does, or where its text is too long, which notes() tell.
  std::string crs() const;

  // Of inputs whose positions are floats, where these are coarse beside the spacing of all.
  std::vector<std::string> notesOfFloats(const CloudTotals& totals) const;
  // How --channels keeps albedos of the inputs from being read, each way once.
  std::string albedoAdvice() const;
  // Of the first input that states sizes.
  const SizeNames& sizeNames() const { return size_names_; }
  // What is to be told of the inputs, with their paths.
  const std::vector<std::string>& notes() const { return notes_; }

  // Whether an input has neither radii nor areas, or coverages.
  bool lacksSizes() const { return lacks_sizes_; }

  // A sample of the surfels, from places spread evenly over all inputs, enough to tell `buckets`
  // equal parts of the curve.
  Result<std::vector<Surfel>> sample(std::uint64_t buckets) const;

  // Takes batches of at most kReadBatch surfels, which it may change, from several threads at once.
  // `bounds` hold their positions, and perhaps those of surfels that it was given before.
  using Consumer = std::function<Status(std::span<Surfel>, const Bounds3& bounds)>;
  // Reads everything. Invalid records are skipped, counted and told through progress.note(), or
  // refused. With the threads of the current arena. Errors: those of the inputs and the consumer;
  // of several bad records the first; kInterrupted.
  Result<CloudTotals> readAll(const Consumer& consume, Progress& progress) const {
    return read({0, record_count_}, consume, progress);
  }
  // The same of some records, counted through all inputs. The totals are of these, but for the
  // channels: those are of all inputs.
  struct Records {
    std::uint64_t begin = 0, end = 0;
  };
  Result<CloudTotals> read(const Records& records, const Consumer& consume,
                           Progress& progress) const;

  // Memory of readAll for this many threads.
  static std::uint64_t memoryBytes(std::size_t read_bytes, int threads);

 private:
  CloudReader() = default;
  Result<CloudTotals> readInput(std::size_t input, const Records& records, const Consumer& consume,
                                Progress& progress) const;
  void addGroupNames(const SurfelSource& source);
  std::vector<MixedCloud> clouds() const;

  std::vector<std::string> inputs_;
  std::vector<std::uint64_t> records_;  // by input
  std::vector<CloudChannels> channels_;
  Groups groups_;  // empty: all have their own
  // By input, those that may be names
  std::vector<std::vector<std::pair<std::uint32_t, std::string>>> group_names_;
  RowReaderOptions reading_;
  SourceOpener opener_;
  bool strict_ = false;
  glm::dvec3 origin_{0};
  std::optional<UpAxis> up_;
  FirstCrs crs_;
  std::vector<std::string> float_inputs_;
  std::vector<std::string> albedo_advice_;
  SizeNames size_names_;
  std::size_t read_bytes_ = 0;
  std::uint64_t record_count_ = 0;
  std::uint64_t file_bytes_ = 0;
  bool is_seekable_ = true;
  bool lacks_sizes_ = false;
  std::vector<std::string> notes_;
};

}  // namespace surfeit
