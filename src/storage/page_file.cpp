#include "storage/page_file.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/assert.h"
#include "storage/byte_coding.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

// The first byte is no ASCII and the last two are line ends, so that a text-mode copy shows
constexpr char kHeaderMagic[8] = {'\x89', 'S', 'F', 'T', '\r', '\n', '\x1a', '\n'};
constexpr char kFooterMagic[8] = {'S', 'F', 'T', ' ', 'e', 'n', 'd', '\n'};

// The largest page count that 32-bit page numbers and this reader's arithmetic allow.
constexpr std::uint64_t kMaxPages = (std::uint64_t{1} << 32) - 2;

std::uint64_t hash(Bytes bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

std::string checksumMismatch(std::uint64_t found, std::uint64_t expected) {
  return fmt::format("checksum {:016x}, expected {:016x}", found, expected);
}

// Entries that are read and checked at a time.
constexpr std::uint64_t kEntriesAtATime = 4096;

}  // namespace

std::uint64_t pageSeed(std::uint64_t file_identity, std::uint64_t offset) {
  // Multiplying by an odd constant spreads neighbouring offsets over all bits
  return file_identity ^ (offset * 0x9e3779b97f4a7c15ull);
}

Status PageFile::partError(const char* part, const std::string& message) const {
  return Status::corruption(fmt::format("{}: {}: {}", path(), part, message));
}

Status PageFile::pageError(std::uint32_t page, const std::string& message) const {
  return Status::corruption(
      fmt::format("{}: page {} at {}: {}", path(), page, entry(page).offset, message));
}

// A message of the file, which names another place when the read was direct, with the page's own.
Status PageFile::readError(std::uint32_t page, const Status& status) const {
  return Status(status.code(),
                fmt::format("{} (page {} at {})", status.message(), page, entry(page).offset));
}

Result<PageFile> PageFile::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path, access));
  return open(std::move(file));
}

Result<PageFile> PageFile::open(InputFile file) {
  PageFile pages;
  pages.file_ = std::move(file);
  SURFEIT_RETURN_IF_ERROR(pages.readHeader());

  std::uint64_t directory_offset = 0, provenance_offset = 0, provenance_checksum = 0;
  SURFEIT_RETURN_IF_ERROR(
      pages.readFooter(directory_offset, provenance_offset, provenance_checksum));

  // Sizes follow from offsets that readFooter has checked
  SURFEIT_RETURN_IF_ERROR(
      pages.readProvenance(provenance_offset, directory_offset, provenance_checksum));
  SURFEIT_RETURN_IF_ERROR(pages.readDirectory(directory_offset, provenance_offset));
  return pages;
}

Status PageFile::readProvenance(std::uint64_t begin, std::uint64_t end, std::uint64_t checksum) {
  provenance_.resize(end - begin);
  const std::span<std::byte> text = std::as_writable_bytes(std::span(provenance_));
  SURFEIT_RETURN_IF_ERROR(file_.readAt(begin, text));
  const std::uint64_t found = hash(text, identity_);
  if (found != checksum) return partError("provenance", checksumMismatch(found, checksum));
  return {};
}

// A part at a time, so that a directory of which the file system stores nothing, a hole, is refused
// before it takes memory. Pages lie between header and provenance, and take as many bytes as there
// are.
Status PageFile::readDirectory(std::uint64_t begin, std::uint64_t pages_end) {
  PageEntry first;
  if (page_count_ > 0) {
    SURFEIT_RETURN_IF_ERROR(file_.readAt(begin, std::as_writable_bytes(std::span(&first, 1))));
    SURFEIT_RETURN_IF_ERROR(checkEntry(0, first, pages_end));
  }
  directory_.reserve(page_count_ * sizeof(PageEntry));
  std::uint64_t bytes = 0;
  Status implausible;
  for (std::uint64_t done = 0; done < page_count_ && implausible.ok(); done += kEntriesAtATime) {
    const std::uint64_t count = std::min(kEntriesAtATime, page_count_ - done);
    const std::span<PageEntry> entries(directory() + done, count);
    SURFEIT_RETURN_IF_ERROR(
        file_.readAt(begin + done * sizeof(PageEntry), std::as_writable_bytes(entries)));
    for (std::uint64_t i = 0; i < count && implausible.ok(); ++i) {
      implausible = checkEntry(static_cast<std::uint32_t>(done + i), entries[i], pages_end);
      bytes += entries[i].stored_bytes;
      max_stored_bytes_ = std::max(max_stored_bytes_, entries[i].stored_bytes);
      max_payload_bytes_ = std::max(max_payload_bytes_, entries[i].payload_bytes);
    }
  }
  SURFEIT_RETURN_IF_ERROR(implausible);
  const Bytes all(directory_.data(), page_count_ * sizeof(PageEntry));
  if (const std::uint64_t found = hash(all, identity_); found != directory_checksum_) {
    return partError("directory", checksumMismatch(found, directory_checksum_));
  }
  if (bytes != pages_end - kFileHeaderBytes) {
    return partError("directory", fmt::format("pages of {} bytes, expected {}", bytes,
                                              pages_end - kFileHeaderBytes));
  }
  return {};
}

Status PageFile::checkEntry(std::uint32_t page, const PageEntry& entry,
                            std::uint64_t pages_end) const {
  if (entry.offset < kFileHeaderBytes || entry.offset > pages_end ||
      entry.stored_bytes > pages_end - entry.offset) {
    return partError("directory",
                     fmt::format("page {} at {} with {} bytes, expected between {} and {}", page,
                                 entry.offset, entry.stored_bytes, kFileHeaderBytes, pages_end));
  }
  if (entry.payload_bytes > kMaxPayloadBytes) {
    return partError("directory", fmt::format("page {} decodes to {} bytes, expected at most {}",
                                              page, entry.payload_bytes, kMaxPayloadBytes));
  }
  const std::uint64_t most = mostStoredBytes(entry.payload_bytes);
  if (entry.stored_bytes < kLeastStoredBytes || entry.stored_bytes > most) {
    return partError("directory",
                     fmt::format("page {} of {} bytes, which decode to {}, expected {} to {}", page,
                                 entry.stored_bytes, entry.payload_bytes, kLeastStoredBytes, most));
  }
  return {};
}

Status PageFile::readHeader() {
  std::vector<std::byte> header(kFileHeaderBytes);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, file_.readSome(0, header));
  // Bytes that the file lacks are zero
  if (std::memcmp(header.data(), kHeaderMagic, 8) != 0) {
    return partError("header", "not a Surfeit scene: the first bytes are not those of a .sft file");
  }
  if (got < kFileHeaderBytes) {
    return partError("header",
                     fmt::format("file ends after {} bytes, expected {}", got, kFileHeaderBytes));
  }
  ByteReader reader(header);
  reader.take(sizeof kHeaderMagic);
  format_version_ = reader.get<std::uint32_t>();
  if (format_version_ == 0 || format_version_ > kFormatVersion) {
    return partError("header", fmt::format("format version {}, this program reads up to {}",
                                           format_version_, kFormatVersion));
  }
  const std::uint32_t header_bytes = reader.get<std::uint32_t>();
  identity_ = reader.get<std::uint64_t>();
  std::uint64_t stored_checksum = 0;
  std::memcpy(&stored_checksum, header.data() + kFileHeaderBytes - 8, 8);
  const std::uint64_t found = hash(Bytes(header).first(kFileHeaderBytes - 8), 0);
  if (found != stored_checksum) {
    return partError("header", checksumMismatch(found, stored_checksum));
  }
  if (header_bytes != kFileHeaderBytes) {
    return partError(
        "header", fmt::format("header of {} bytes, expected {}", header_bytes, kFileHeaderBytes));
  }
  scene_fields_.assign(header.begin() + kSceneFieldsOffset,
                       header.begin() + kSceneFieldsOffset + kSceneFieldsBytes);
  return {};
}

Status PageFile::readFooter(std::uint64_t& directory_offset, std::uint64_t& provenance_offset,
                            std::uint64_t& provenance_checksum) {
  constexpr std::uint64_t kFrameBytes = kFileHeaderBytes + kFileFooterBytes;
  if (fileBytes() < kFrameBytes) {
    return partError("footer", fmt::format("file of {} bytes, expected at least {}: it was not "
                                           "finished or was cut",
                                           fileBytes(), kFrameBytes));
  }
  std::byte footer[kFileFooterBytes];
  SURFEIT_RETURN_IF_ERROR(file_.readAt(fileBytes() - kFileFooterBytes, footer));
  ByteReader reader(footer);
  provenance_offset = reader.get<std::uint64_t>();
  directory_offset = reader.get<std::uint64_t>();
  provenance_checksum = reader.get<std::uint64_t>();
  directory_checksum_ = reader.get<std::uint64_t>();
  const std::uint64_t file_bytes = reader.get<std::uint64_t>();
  const std::uint64_t node_pages = reader.get<std::uint64_t>();
  const std::uint64_t checksum = reader.get<std::uint64_t>();
  if (std::memcmp(reader.take(8).data(), kFooterMagic, 8) != 0) {
    return partError("footer",
                     "missing: the file was not finished, was cut, or has bytes appended");
  }
  if (const std::uint64_t found = hash(Bytes(footer).first(kFileFooterBytes - 16), identity_);
      found != checksum) {
    return partError("footer", checksumMismatch(found, checksum));
  }
  if (file_bytes != fileBytes()) {
    return partError("footer",
                     fmt::format("file of {} bytes, expected {}", fileBytes(), file_bytes));
  }

  // Parts lie in order and the directory holds whole entries
  const std::uint64_t directory_end = fileBytes() - kFileFooterBytes;
  if (provenance_offset < kFileHeaderBytes || provenance_offset > directory_offset ||
      directory_offset > directory_end) {
    return partError("footer", fmt::format("provenance at {} and directory at {} do not fit a file "
                                           "of {} bytes",
                                           provenance_offset, directory_offset, fileBytes()));
  }
  if (directory_offset - provenance_offset > kMaxProvenanceBytes) {
    return partError("footer",
                     fmt::format("provenance of {} bytes, expected at most {}",
                                 directory_offset - provenance_offset, kMaxProvenanceBytes));
  }
  const std::uint64_t directory_bytes = directory_end - directory_offset;
  const std::uint64_t pages = directory_bytes / sizeof(PageEntry);
  if (directory_bytes % sizeof(PageEntry) != 0 || pages > kMaxPages || node_pages > pages) {
    return partError("footer", fmt::format("directory of {} bytes with {} node pages is no whole "
                                           "number of entries",
                                           directory_bytes, node_pages));
  }
  const std::uint64_t most_pages = (provenance_offset - kFileHeaderBytes) / kLeastStoredBytes;
  if (pages > most_pages) {
    return partError("footer",
                     fmt::format("directory of {} pages, expected at most {} in {} bytes", pages,
                                 most_pages, provenance_offset - kFileHeaderBytes));
  }
  page_count_ = static_cast<std::uint32_t>(pages);
  node_page_count_ = static_cast<std::uint32_t>(node_pages);
  return {};
}

Status PageFile::checkTiling() const {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(pageCount());  // offset, page
  for (std::uint32_t page = 0; page < pageCount(); ++page) order[page] = {entry(page).offset, page};
  std::sort(order.begin(), order.end());
  std::uint64_t expected_offset = kFileHeaderBytes;
  for (const auto& [offset, page] : order) {
    if (offset != expected_offset) {
      return partError("directory",
                       fmt::format("page {} at {}, expected at {}", page, offset, expected_offset));
    }
    expected_offset += entry(page).stored_bytes;
  }
  return {};
}

// The bytes of a page, checked: from the stage where they are there, else from the file.
Result<Bytes> PageFile::readStored(std::uint32_t page, AlignedBuffer& stored) const {
  const PageEntry& at = entry(page);
  const auto isPage = [&](Bytes bytes) {
    return hash(bytes, pageSeed(identity_, at.offset)) == at.checksum;
  };
  if (stage_ != nullptr) {
    const Bytes staged = stage_->find(file_, at.offset, at.stored_bytes, isPage, stored);
    if (!staged.empty()) return staged;
  }
  const Result<Bytes> read = file_.readView(at.offset, at.stored_bytes, stored);
  if (!read.ok()) return readError(page, read.status());
  const Bytes bytes = *read;
  if (bytes.size() != at.stored_bytes) {
    return pageError(
        page, fmt::format("file ends early: {} bytes, expected {}", bytes.size(), at.stored_bytes));
  }
  if (const std::uint64_t found = hash(bytes, pageSeed(identity_, at.offset));
      found != at.checksum) {
    return pageError(page, checksumMismatch(found, at.checksum));
  }
  return bytes;
}

Status PageFile::readPage(std::uint32_t page, AlignedBuffer& stored,
                          std::vector<std::byte>& payload) const {
  SURFEIT_ASSERT(page < pageCount());
  SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, readStored(page, stored));
  const PageEntry& at = entry(page);
  payload.resize(at.payload_bytes);
  const Status status = decompressPage(bytes, payload);
  return status.ok() ? Status() : pageError(page, status.message());
}

Result<PageFileWriter> PageFileWriter::create(const std::string& path, std::uint64_t identity,
                                              std::uint32_t format_version) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  // Room for the header, which is written last
  const std::vector<std::byte> header(kFileHeaderBytes);
  SURFEIT_RETURN_IF_ERROR(file.append(header));
  return PageFileWriter(std::move(file), identity, format_version);
}

Status PageFileWriter::addPage(Bytes stored, std::uint32_t payload_bytes,
                               std::deque<PageEntry>& pages) {
  SURFEIT_CHECK(payload_bytes <= kMaxPayloadBytes);
  if (page_count_ >= kMaxPages) {
    return Status::failed(fmt::format("{}: more than {} pages", file_.path(), kMaxPages));
  }
  ++page_count_;
  const std::uint64_t offset = file_.size();
  pages.push_back({offset, static_cast<std::uint32_t>(stored.size()), payload_bytes,
                   hash(stored, pageSeed(identity_, offset))});
  return file_.append(stored);
}

Status PageFileWriter::addSurfelPage(Bytes stored, std::uint32_t payload_bytes) {
  return addPage(stored, payload_bytes, surfel_pages_);
}

Status PageFileWriter::addNodePage(Bytes stored, std::uint32_t payload_bytes, std::size_t level) {
  SURFEIT_CHECK(level < kMaxNodeLevels);
  return addPage(stored, payload_bytes, node_pages_[level]);
}

// Node pages level by level, then surfel pages.
Status PageFileWriter::appendDirectory(std::uint64_t& checksum) {
  XXH3_state_t* const state = XXH3_createState();
  if (state == nullptr) return Status::failed("no memory for a checksum");
  XXH3_64bits_reset_withSeed(state, identity_);
  Status status;
  const auto append = [&](const std::deque<PageEntry>& pages) {
    for (auto entry = pages.begin(); entry != pages.end() && status.ok(); ++entry) {
      const Bytes bytes = std::as_bytes(std::span(&*entry, 1));
      XXH3_64bits_update(state, bytes.data(), bytes.size());
      status = file_.append(bytes);
    }
  };
  for (const std::deque<PageEntry>& level : node_pages_) append(level);
  append(surfel_pages_);
  checksum = XXH3_64bits_digest(state);
  XXH3_freeState(state);
  return status;
}

Status PageFileWriter::finish(Bytes scene_fields, const std::string& provenance) {
  SURFEIT_RETURN_IF_ERROR(complete(scene_fields, provenance));
  return file_.commit();
}

Result<PageFile> PageFileWriter::finishUnnamed(Bytes scene_fields, const std::string& provenance) {
  SURFEIT_RETURN_IF_ERROR(complete(scene_fields, provenance));
  // Cached: its pages are read in order, and their neighbours again and again
  SURFEIT_ASSIGN_OR_RETURN(
      InputFile file,
      file_.finishUnnamed(fmt::format("temporary scene in {}", directoryOf(file_.path())),
                          Access::kCached));
  return PageFile::open(std::move(file));
}

// Writes all that follows the pages, and the header.
Status PageFileWriter::complete(Bytes scene_fields, const std::string& provenance) {
  SURFEIT_CHECK(scene_fields.size() <= kSceneFieldsBytes);
  if (provenance.size() > kMaxProvenanceBytes) {
    return Status::invalidArgument(fmt::format("{}: provenance of {} bytes, expected at most {}",
                                               file_.path(), provenance.size(),
                                               kMaxProvenanceBytes));
  }
  // Provenance and directory
  const std::uint64_t provenance_offset = file_.size();
  const Bytes text = std::as_bytes(std::span(provenance));
  SURFEIT_RETURN_IF_ERROR(file_.append(text));
  const std::uint64_t directory_offset = file_.size();
  std::uint64_t directory_checksum = 0;
  SURFEIT_RETURN_IF_ERROR(appendDirectory(directory_checksum));
  std::uint64_t node_pages = 0;
  for (const std::deque<PageEntry>& level : node_pages_) node_pages += level.size();

  // Footer
  std::vector<std::byte> footer;
  ByteWriter writer(footer);
  writer.put(provenance_offset);
  writer.put(directory_offset);
  writer.put(hash(text, identity_));
  writer.put(directory_checksum);
  writer.put(file_.size() + kFileFooterBytes);
  writer.put(node_pages);
  writer.put(hash(footer, identity_));
  writer.putBytes(std::as_bytes(std::span(kFooterMagic)));
  SURFEIT_RETURN_IF_ERROR(file_.append(footer));

  // Header
  std::vector<std::byte> header;
  ByteWriter head(header);
  head.putBytes(std::as_bytes(std::span(kHeaderMagic)));
  head.put(format_version_);
  head.put(static_cast<std::uint32_t>(kFileHeaderBytes));
  head.put(identity_);
  header.resize(kSceneFieldsOffset);
  head.putBytes(scene_fields);
  header.resize(kFileHeaderBytes - 8);
  head.put(hash(header, 0));
  return file_.writeAt(0, header);
}

}  // namespace surfeit
