// The container of a .sft file: header, pages, provenance, directory, footer. It knows offsets,
// sizes and checksums, not what the pages hold. docs/format.md, "Container", has every byte.
//
//   [ header : 512 | pages | provenance | directory | footer : 64 ]
//
// Nothing lies between parts or pages, so that every byte of the file is under one checksum. Pages
// lie in the order in which they were finished, node pages among surfel pages of their region; the
// directory has them by number.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "storage/file.h"
#include "storage/page_stage.h"
#include "surfeit/status.h"
#include "surfeit/version.h"

namespace surfeit {

inline constexpr std::size_t kFileHeaderBytes = 512;
inline constexpr std::size_t kFileFooterBytes = 64;
// Fields of the scene, between the container's own and the header's checksum.
inline constexpr std::size_t kSceneFieldsOffset = 64;
inline constexpr std::size_t kSceneFieldsBytes = kFileHeaderBytes - kSceneFieldsOffset - 8;
// No page decodes to more than this; what declares more is refused before anything is allocated.
inline constexpr std::uint32_t kMaxPayloadBytes = 4 << 20;
// Nor is a longer provenance written or read.
inline constexpr std::uint64_t kMaxProvenanceBytes = 64 << 10;

// Where a page lies and what it must hash to.
struct PageEntry {
  std::uint64_t offset = 0;
  std::uint32_t stored_bytes = 0;
  std::uint32_t payload_bytes = 0;
  std::uint64_t checksum = 0;  // XXH3-64 of the stored bytes, seeded by pageSeed
};
static_assert(sizeof(PageEntry) == 24);

// The seed of a page's checksum: a page of another file, or at another offset, does not pass.
std::uint64_t pageSeed(std::uint64_t file_identity, std::uint64_t offset);

// A file open for reading. Immutable; safe from any thread.
class PageFile {
 public:
  // Checks everything but the pages. kCorruption names file, part, found and expected; a newer
  // version is refused with its number. Memory is what memoryBytes() says; of a directory or
  // provenance that cannot be true no more is read than shows that. `access` is how readPage reads;
  // all else is cached.
  static Result<PageFile> open(const std::string& path, Access access = Access::kCached);
  static Result<PageFile> open(InputFile file);

  const std::string& path() const { return file_.path(); }
  std::uint64_t fileBytes() const { return file_.size(); }
  std::uint32_t formatVersion() const { return format_version_; }
  std::uint64_t identity() const { return identity_; }
  Bytes sceneFields() const { return scene_fields_; }
  const std::string& provenance() const { return provenance_; }

  // Bytes of the directory and the provenance.
  std::uint64_t memoryBytes() const {
    return page_count_ * sizeof(PageEntry) + provenance_.capacity();
  }

  // Pages are numbered through: node pages first, then surfel pages.
  std::uint32_t pageCount() const { return page_count_; }
  std::uint32_t nodePageCount() const { return node_page_count_; }
  const PageEntry& entry(std::uint32_t page) const { return directory()[page]; }
  // Differs between two files unless identity and the bytes and places of all pages are the same.
  std::uint64_t directoryChecksum() const { return directory_checksum_; }
  // Most stored and decoded bytes of any page.
  std::uint32_t maxStoredBytes() const { return max_stored_bytes_; }
  std::uint32_t maxPayloadBytes() const { return max_payload_bytes_; }

  // Reads, checks and decompresses a page into `payload`, with `stored` as scratch: it grows to at
  // most two alignments more than maxStoredBytes(). page must be below pageCount(). Messages read
  // "scene.sft: page 1832 at 30015488: checksum ..., expected ...".
  Status readPage(std::uint32_t page, AlignedBuffer& stored, std::vector<std::byte>& payload) const;
  // From now on pages are looked for there first, and kept there when they are read. Before other
  // threads read.
  void setStage(std::shared_ptr<PageStage> stage) { stage_ = std::move(stage); }
  // Null unless there is one.
  const std::shared_ptr<PageStage>& stage() const { return stage_; }
  // Whether the pages fill the space between header and provenance without gap or overlap: that
  // they do in sum, open has checked. Takes memory of 16 bytes per page.
  Status checkTiling() const;
  // Prefixes a message about a page's contents with file, page and offset, as kCorruption.
  Status pageError(std::uint32_t page, const std::string& message) const;

 private:
  Status readHeader();
  Status readFooter(std::uint64_t& directory_offset, std::uint64_t& provenance_offset,
                    std::uint64_t& provenance_checksum);
  Status readProvenance(std::uint64_t begin, std::uint64_t end, std::uint64_t checksum);
  Status readDirectory(std::uint64_t begin, std::uint64_t pages_end);
  Status checkEntry(std::uint32_t page, const PageEntry& entry, std::uint64_t pages_end) const;
  Status readError(std::uint32_t page, const Status& status) const;
  Status partError(const char* part, const std::string& message) const;

  Result<Bytes> readStored(std::uint32_t page, AlignedBuffer& stored) const;
  PageEntry* directory() const { return reinterpret_cast<PageEntry*>(directory_.data()); }

  InputFile file_;
  std::shared_ptr<PageStage> stage_;
  std::uint32_t format_version_ = 0;
  std::uint64_t identity_ = 0;
  std::uint32_t page_count_ = 0;
  std::uint32_t node_page_count_ = 0;
  std::vector<std::byte> scene_fields_;
  std::string provenance_;
  AlignedBuffer directory_;  // entries; touched as they are read
  std::uint64_t directory_checksum_ = 0;
  std::uint32_t max_stored_bytes_ = 0;
  std::uint32_t max_payload_bytes_ = 0;
};

// Writes a file; it appears when finish() succeeds. One thread at a time; 24 bytes per page.
class PageFileWriter {
 public:
  // `identity` must differ between files of different content and be the same for the same content.
  // `format_version` is that of the pages to come.
  static Result<PageFileWriter> create(const std::string& path, std::uint64_t identity,
                                       std::uint32_t format_version = kFormatVersion);

  // `stored` is a page that compressPage made of payload_bytes bytes. Surfel pages are numbered as
  // they come, node pages level by level (below kMaxNodeLevels); the kinds and the levels may take
  // turns.
  static constexpr std::size_t kMaxNodeLevels = 22;
  Status addSurfelPage(Bytes stored, std::uint32_t payload_bytes);
  Status addNodePage(Bytes stored, std::uint32_t payload_bytes, std::size_t level = 0);

  std::uint64_t surfelPageCount() const { return surfel_pages_.size(); }
  std::uint64_t nodePageCount(std::size_t level) const { return node_pages_[level].size(); }

  // Writes what remains. scene_fields: at most kSceneFieldsBytes. kInvalidArgument when the
  // provenance is longer than kMaxProvenanceBytes.
  Status finish(Bytes scene_fields, const std::string& provenance);
  // The same, but the file gets no name: it is returned, opened and checked, and goes with its last
  // reader.
  Result<PageFile> finishUnnamed(Bytes scene_fields, const std::string& provenance);

  std::uint64_t fileBytes() const { return file_.size(); }

 private:
  PageFileWriter(AtomicFile file, std::uint64_t identity, std::uint32_t format_version)
      : file_(std::move(file)), identity_(identity), format_version_(format_version) {}
  Status addPage(Bytes stored, std::uint32_t payload_bytes, std::deque<PageEntry>& pages);
  Status appendDirectory(std::uint64_t& checksum);
  Status complete(Bytes scene_fields, const std::string& provenance);

  AtomicFile file_;
  std::uint64_t identity_;
  std::uint32_t format_version_;
  // Lists that do not move when they grow
  std::deque<PageEntry> surfel_pages_;
  std::array<std::deque<PageEntry>, kMaxNodeLevels> node_pages_;
  std::uint64_t page_count_ = 0;
};

}  // namespace surfeit
