#include "cloud/cloud_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "cloud/edits/color_reader.h"
#include "cloud/edits/moved_positions.h"
#include "cloud/exr/exr_reader.h"
#include "cloud/exr/exr_writer.h"
#include "cloud/houdini/bgeo_ascii_reader.h"
#include "cloud/houdini/bgeo_json_reader.h"
#include "cloud/houdini/bgeo_reader.h"
#include "cloud/houdini/bgeo_writer.h"
#include "cloud/particles/pdb_reader.h"
#include "cloud/particles/pdb_writer.h"
#include "cloud/particles/prt2_reader.h"
#include "cloud/particles/prt_reader.h"
#include "cloud/particles/prt_writer.h"
#include "cloud/particles/ptc_reader.h"
#include "cloud/particles/ptc_writer.h"
#include "cloud/parts/lost_comments.h"
#include "cloud/ply/ply_rows.h"
#include "cloud/scans/las_reader.h"
#include "cloud/scans/las_writer.h"
#include "cloud/scans/pcd_reader.h"
#include "cloud/scans/ptx_reader.h"
#include "cloud/text/xyz_reader.h"
#include "cloud/text/xyz_writer.h"
#include "cloud/vdb/vdb_output.h"
#include "cloud/vdb/vdb_reader.h"
#include "cloud/vdb/vdb_writer.h"
#include "core/text_case.h"
#include "core/up_comment.h"
#include "storage/byte_output.h"
#include "storage/compression.h"
#include "storage/output_target.h"

namespace surfeit {
namespace {

// Formats with a magic first; text, which is recognised by looking at more, last.
constexpr CloudFormat kFormats[] = {
    {"PLY", ".ply", recognisesPly, openPlyRows, createPlyRows, CloudFormat::kStatesUp},
    {"OpenEXR", ".exr", recognisesExr, openExr, createExr,
     CloudFormat::kReadInPlaces | CloudFormat::kFloatPositions},
    {"PTC", ".ptc", recognisesPtc, openPtc, createPtc, CloudFormat::kFloatPositions},
    {"OpenVDB", ".vdb", recognisesVdb, openVdb, createVdb,
     CloudFormat::kReadInPlaces | CloudFormat::kStatesUp},
    {"LAS", ".las", recognisesLas, openLas, createLas, CloudFormat::kHasUpZ},
    {"PCD", "", recognisesPcd, openPcd, nullptr},
    {"PRT", ".prt", recognisesPrt, openPrt, createPrt},
    {"PRT 2", "", recognisesPrt2, openPrt2, nullptr},
    {"BGEO", ".bgeo", recognisesBgeo, openBgeo, createBgeo, CloudFormat::kFloatPositions},
    {"BGEO", "", recognisesBgeoJson, openBgeoJson, nullptr},
    {"GEO", "", recognisesBgeoAscii, openBgeoAscii, nullptr},
    {"PDB", ".pdb", recognisesPdb, openPdb, createPdb, CloudFormat::kFloatPositions},
    // Text stands last
    {"PTX", "", recognisesPtx, openPtx, nullptr},
    {"xyz text", ".xyz .txt .asc .csv", recognisesXyz, openXyz, createXyz, CloudFormat::kStatesUp},
};

// Known formats that are not read, and what to do instead.
struct OtherFormat {
  std::string_view magic, name, advice;  // magic: the first bytes, or the extension
};
using namespace std::string_view_literals;
constexpr std::string_view kSceneMagic = "\x89SFT";
constexpr std::string_view kPictureAdvice =
    "pictures are textures of `sample` and environments of `gather`; passes are .exr";
constexpr std::string_view kMeshAdvice =
    "save meshes as PLY or OBJ for `surfeit sample`, points as PLY";
constexpr std::string_view kTableAdvice = "save the points as PLY or CSV";
constexpr std::string_view kGridAdvice =
    "write the points of a map of heights as text: `gdal_translate -of XYZ IN OUT.xyz`";
constexpr std::string_view kScannerAdvice =
    "save the points as LAS or PLY with the program of the scanner, or with CloudCompare";
constexpr OtherFormat kOtherFormats[] = {
    {kSceneMagic, "a Surfeit scene (.sft)",
     "give the cloud that it was indexed from, or make one: surfeit convert SCENE.sft -o "
     "CLOUD.ply"},
    {"surfeit-recipe"sv, "a recipe of `surfeit generate`", "give it to `surfeit index`"},
    {"ASTM-E57"sv, "E57",
     "convert it to LAS or PLY first: `pdal translate IN.e57 OUT.las`, CloudCompare 2.12 or later, "
     "or Python (`pip install pye57`)"},
    {"ICECACHE"sv, "a particle cache of Softimage ICE",
     "save it as .bgeo, .prt or .pdb (partconv)"},
    {"scf1"sv, "compressed geometry of Houdini (.bgeo.sc)",
     "save it as .bgeo or .bgeo.gz (gconvert)"},
    {"[\"fileversion"sv, "Houdini's geometry as text (.geo)", "save it as .bgeo (gconvert)"},
    {"[\n\t\"fileversion"sv, "Houdini's geometry as text (.geo)", "save it as .bgeo (gconvert)"},
    {"NGSP"sv, "SPZ", "convert it to the PLY of Gaussian splats first"},
    {"Ogawa"sv, "Alembic", "save the points as PLY, .bgeo or .vdb"},
    {"\x89HDF"sv, "HDF5 (Alembic)", "save the points as PLY, .bgeo or .vdb"},
    {"PXR-USDC"sv, "USD", "save the points as PLY, .bgeo or .vdb"},
    {"#usda"sv, "USD", "save the points as PLY, .bgeo or .vdb"},
    {"HAIR"sv, "HAIR", "convert its strands to points or meshes first"},
    {"#?RADIANCE"sv, "a Radiance picture", kPictureAdvice},
    {"#?RGBE"sv, "a Radiance picture", kPictureAdvice},
    {"\xFF\xD8\xFF"sv, "a JPEG picture", kPictureAdvice},
    {"\x89PNG"sv, "a PNG picture", kPictureAdvice},
    {"\xFF\xFE"sv, "text in UTF-16", "save it as UTF-8 or ASCII"},
    {"\xFE\xFF"sv, "text in UTF-16", "save it as UTF-8 or ASCII"},
    {"PK\x03\x04"sv, "a ZIP archive", "unpack it first"},
    {"Rar!"sv, "a RAR archive", "unpack it first"},
    {"7z\xBC\xAF"sv, "a 7z archive", "unpack it first"},
    {"\x04\x22\x4D\x18"sv, "lz4", "unpack it first; gzip and zstd are read as they are"},
    {"glTF"sv, "glTF", kMeshAdvice},
    {"solid "sv, "STL", kMeshAdvice},
    {"OFF"sv, "OFF", kMeshAdvice},
    {"COFF"sv, "OFF", kMeshAdvice},
    {"Kaydara FBX"sv, "FBX", kMeshAdvice},
    {"# vtk"sv, "VTK", kTableAdvice},
    {"<?xml"sv, "XML", kTableAdvice},
    {"{"sv, "JSON", kTableAdvice},
    {"PAR1"sv, "Parquet", kTableAdvice},
    {"\x93NUMPY"sv, "an array of NumPy",
     "the package surfeit for Python takes arrays (docs/python.md)"},
    {"ncols"sv, "a grid of heights (ESRI)", kGridAdvice},
    {"II*\0"sv, "a TIFF picture", kGridAdvice},
    {"MM\0*"sv, "a TIFF picture", kGridAdvice},
    {"version https://git-lfs"sv, "a pointer of Git LFS", "fetch the file itself: `git lfs pull`"},
    {"<!DOCTYPE"sv, "a web page", "download the file itself"},
    {"<html"sv, "a web page", "download the file itself"},
    {"\x1F\x8B"sv, "gzip within gzip or zstd", "unpack it once"},
    {"\x28\xB5\x2F\xFD"sv, "zstd within gzip or zstd", "unpack it once"},
    {"#ROSBAG"sv, "a ROS bag", "save the clouds in it as PCD: `rosrun pcl_ros bag_to_pcd`"},
    {"DSAA"sv, "a grid of heights (Surfer)", kGridAdvice},
    {"DSBB"sv, "a grid of heights (Surfer)", kGridAdvice},
    {"DSRB"sv, "a grid of heights (Surfer)", kGridAdvice},
    {"#VRML"sv, "VRML", kMeshAdvice},
    {"BLENDER"sv, "a scene of Blender", kMeshAdvice},
    {"\xD4\xC3\xB2\xA1"sv, "packets of a scanner (pcap)", kScannerAdvice},
    {"\x0A\x0D\x0D\x0A"sv, "packets of a scanner (pcapng)", kScannerAdvice},
    {"BZh"sv, "bzip2", "unpack it first; gzip and zstd are read as they are"},
    {"\xFD\x37zXZ"sv, "xz", "unpack it first; gzip and zstd are read as they are"},
};

constexpr std::string_view kSplatAdvice =
    "convert it to the PLY of Gaussian splats, for example with SuperSplat";

// Those that only their names tell.
constexpr OtherFormat kOtherExtensions[] = {
    {".splat"sv, "Gaussian splats of a viewer (.splat)", kSplatAdvice},
    {".ksplat"sv, "Gaussian splats of a viewer (.ksplat)", kSplatAdvice},
    {".stl"sv, "STL", kMeshAdvice},
    {".dxf"sv, "DXF", kTableAdvice},
    {".fls"sv, "a scan of FARO (.fls)", kScannerAdvice},
    {".rcp"sv, "a scan of ReCap (.rcp)", kScannerAdvice},
    {".rcs"sv, "a scan of ReCap (.rcs)", kScannerAdvice},
    {".zfs"sv, "a scan of Z+F (.zfs)", kScannerAdvice},
    {".tar"sv, "an archive (tar)", "unpack it first"},
    {".bin"sv, "numbers without a header (.bin)",
     "the package surfeit for Python takes arrays (docs/python.md): "
     "numpy.fromfile(NAME, 'f4').reshape(-1, 4)"},
};

// "PLY, PTC and PRT"
std::string namesOfRead() {
  std::vector<std::string_view> names;
  for (const CloudFormat& format : kFormats) {
    const bool is_new = std::find(names.begin(), names.end(), format.name) == names.end();
    if (format.open != nullptr && is_new) names.push_back(format.name);
  }
  const std::string_view last = names.back();
  names.pop_back();
  return names.empty() ? std::string(last) : fmt::format("{} and {}", fmt::join(names, ", "), last);
}

std::string extensionsWritten() {
  std::string text;
  for (const CloudFormat& format : kFormats) {
    if (format.create == nullptr) continue;
    text += (text.empty() ? "" : " ") + std::string(format.extensions);
  }
  return text;
}

// Whether a list of extensions, separated by blanks, has one that `path` ends with, in any case.
bool hasExtension(std::string_view path, std::string_view extensions) {
  while (!extensions.empty()) {
    const std::size_t end = std::min(extensions.find(' '), extensions.size());
    const std::string_view extension = extensions.substr(0, end);
    if (!extension.empty() && path.size() > extension.size() && hasEnding(path, extension)) {
      return true;
    }
    extensions.remove_prefix(std::min(end + 1, extensions.size()));
  }
  return false;
}

// Whether every other byte is 0 and the rest is ASCII.
bool isUtf16(std::string_view first_bytes) {
  if (first_bytes.size() < 8) return false;
  const std::size_t zero = first_bytes[0] == '\0' ? 0 : 1;
  for (std::size_t i = 0; i < first_bytes.size(); ++i) {
    const bool is_ascii = first_bytes[i] > '\0' && (first_bytes[i] & 0x80) == 0;
    if (i % 2 == zero ? first_bytes[i] != '\0' : !is_ascii) return false;
  }
  return true;
}

// Whether a name says that the file is text, which content alone does not tell where rows begin
// with words.
bool isTextName(std::string_view path) {
  return hasExtension(withoutCompression(path), ".xyz .txt .asc .csv .pts");
}

// Of a file that is of no format that is read; nullopt: not known.
std::optional<OtherFormat> otherFormatOf(const std::string& path, std::string_view first_bytes) {
  if (hasEnding(path, ".xlsx")) return OtherFormat{{}, "a spreadsheet (.xlsx)", "save it as CSV"};
  if (hasEnding(path, ".sog")) {
    return OtherFormat{{}, "Gaussian splats of SuperSplat (.sog)", kSplatAdvice};
  }
  for (const OtherFormat& other : kOtherFormats) {
    if (first_bytes.starts_with(other.magic)) return other;
  }
  if (isUtf16(first_bytes)) {
    return OtherFormat{{}, "text in UTF-16", "save it as UTF-8 or ASCII"};
  }
  for (const OtherFormat& other : kOtherExtensions) {
    if (hasEnding(path, other.magic)) return other;
  }
  return std::nullopt;
}

Status unknownFormat(const std::string& path, std::string_view first_bytes) {
  if (const std::optional<OtherFormat> other = otherFormatOf(path, first_bytes)) {
    return Status::corruption(fmt::format("{}: found {}, which is not read as a cloud: {}", path,
                                          other->name, other->advice));
  }
  if (first_bytes.empty()) {
    return Status::corruption(path + ": the file is empty, expected a cloud");
  }
  if (first_bytes.find_first_not_of('\0') == first_bytes.npos) {
    return Status::corruption(
        fmt::format("{}: the first {} bytes are all 0: was it copied or downloaded as a whole?",
                    path, first_bytes.size()));
  }
  // What the name says is text can tell the line that is none
  if (isTextName(path)) {
    const Status text = openXyz(path, {}).status();
    if (!text.ok()) return text;
  }
  return Status::corruption(fmt::format(
      "{}: found {} at 0, expected a cloud ({}); `surfeit sample` makes one of a mesh (.obj)", path,
      quoteText(first_bytes.substr(0, 4)), namesOfRead()));
}

bool namesColumnsByNumber(std::span<const ChannelRename> renames) {
  return std::any_of(renames.begin(), renames.end(), [](const ChannelRename& rename) {
    return rename.from.find_first_not_of("0123456789") == rename.from.npos;
  });
}

// Tells apart what a filter takes of files.
std::string selectionKey(const std::string& path, const RowReaderOptions& options) {
  std::string key = path + '\n' + options.part + '\n' + options.filter;
  for (const ChannelRename& rename : options.channels) {
    key += '\n' + rename.from + '=' + rename.to;
  }
  return key;
}

}  // namespace

std::span<const CloudFormat> cloudFormats() { return kFormats; }

bool isSceneFile(std::string_view first_bytes) { return first_bytes.starts_with(kSceneMagic); }

Result<std::unique_ptr<RowReader>> openRowReader(const std::string& path,
                                                 const RowReaderOptions& options) {
  std::string first_bytes(kMagicBytes, '\0');
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                           input.readSome(0, std::as_writable_bytes(std::span(first_bytes))));
  first_bytes.resize(size);
  for (const CloudFormat& format : kFormats) {
    const bool is_named_text =
        format.open == openXyz && isTextName(path) && namesColumnsByNumber(options.channels);
    if (format.open == nullptr || !(format.recognises(first_bytes) || is_named_text)) continue;
    if (input.isCompressed() && format.has(CloudFormat::kReadInPlaces)) {
      return Status::corruption(
          fmt::format("{}: found {} compressed as a whole, expected it as it is: unpack it first "
                      "(gunzip, unzstd)",
                      path, format.name));
    }
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, format.open(path, options));
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(reader->element(), path));
    SURFEIT_ASSIGN_OR_RETURN(
        reader, filterRows(std::move(reader), options.filter, selectionKey(path, options),
                           options.selections.get()));
    if (options.color_range) return readColors(std::move(reader), *options.color_range);
    return reader;
  }
  return unknownFormat(path, first_bytes);
}

std::string nameOfOtherFormat(const std::string& path, std::string_view first_bytes) {
  const std::optional<OtherFormat> other = otherFormatOf(path, first_bytes);
  return other ? std::string(other->name) : std::string();
}

Result<std::optional<ColorRange>> colorRangeFor(std::span<const std::string> inputs,
                                                const std::string& output, ColorRange asked) {
  const std::optional<ColorRange> as_asked = asked;
  if (asked != ColorRange::kAuto || !hasExtension(withoutCompression(output), ".las")) {
    return as_asked;
  }
  for (const std::string& path : inputs) {
    std::string first_bytes(8, '\0');
    SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                             input.readSome(0, std::as_writable_bytes(std::span(first_bytes))));
    if (!recognisesLas(std::string_view(first_bytes).substr(0, size))) return as_asked;
  }
  return std::optional<ColorRange>();
}

const CloudFormat* formatWritten(const std::string& path) {
  // Standard output has no name: it is PLY, or what follows the dash (-.csv)
  const std::string_view name = path == "-" ? std::string_view("-.ply") : withoutCompression(path);
  for (const CloudFormat& format : kFormats) {
    if (format.create != nullptr && hasExtension(name, format.extensions)) return &format;
  }
  return nullptr;
}

void noteSceneName(const std::string& output, Progress& progress) {
  const CloudFormat* const format = formatWritten(output);
  if (output == "-" || format == nullptr) return;
  progress.note(fmt::format(
      "{}: a scene, under a name of {} files: other programs will not open it, name it .sft; "
      "convert writes clouds",
      output, format->name));
}

std::uint64_t heldWriterBytes(const std::string& path, std::uint64_t count, std::size_t row_bytes) {
  return hasExtension(path, ".vdb") ? count * (row_bytes + sizeof(VdbEntry)) : 0;
}

namespace {

// Tells when what is up in the rows will not be known from the file. Pictures stay what they are.
void noteLostUpAxis(const std::string& path, const CloudFormat& format,
                    const RowWriterOptions& options) {
  const UpAxis up = statedUpAxis(options.comments).value_or(kDefaultUpAxis);
  const UpAxis own = format.has(CloudFormat::kHasUpZ) ? UpAxis::kZ : kDefaultUpAxis;
  const bool is_csv = hasExtension(withoutCompression(path), ".csv");
  const bool states_up = format.has(CloudFormat::kStatesUp) && !is_csv;
  if (states_up || own == up || options.progress == nullptr) return;
  if (format.create == createExr) return;
  options.progress->note(
      fmt::format("{}: {} has no place for the up axis, {}: give --up {} where it is read", path,
                  is_csv ? "CSV" : format.name, upAxisName(up), upAxisName(up)));
}

// Other formats without comments say so themselves.
void noteLostComments(const std::string& path, const CloudFormat& format,
                      const RowWriterOptions& options) {
  if (format.create != createPtc || options.progress == nullptr) return;
  for (const std::string& note : notesOfLostComments(format.name, options.comments)) {
    options.progress->note(fmt::format("{}: {}", path, note));
  }
}

// Of a PLY.
std::uint64_t rowBytesOf(const RowWriterOptions& writing) {
  std::uint64_t bytes = 0;
  for (const RowProperty& property : writing.properties) {
    bytes += writing.ply_encoding == PlyEncoding::kAscii ? 2 : valueTypeBytes(property.type);
  }
  return bytes;
}

}  // namespace

Result<std::unique_ptr<RowWriter>> createRowWriter(const std::string& path,
                                                   const RowWriterOptions& options) {
  const CloudFormat* const format = formatWritten(path);
  if (format == nullptr) {
    return Status::invalidArgument(fmt::format(
        "{}: expected a name that ends with one of {}, with or without .gz or .zst behind it; - "
        "is PLY to standard output, -.csv CSV",
        path, extensionsWritten()));
  }
  RowWriterOptions writing = options;
  if (writing.like != nullptr) writing.like = &writing.like->file();
  noteLostUpAxis(path, *format, writing);
  noteLostComments(path, *format, writing);
  if (writing.count && path != "-" && withoutCompression(path) == path &&
      format->extensions == ".ply") {
    SURFEIT_RETURN_IF_ERROR(checkOutputRoom(path, *writing.count * rowBytesOf(writing)));
  }
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowWriter> writer, format->create(path, writing));
  return format->has(CloudFormat::kFloatPositions) ? watchPositions(std::move(writer))
                                                   : std::move(writer);
}

}  // namespace surfeit
