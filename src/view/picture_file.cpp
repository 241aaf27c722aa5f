#include "view/picture_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "storage/file.h"

namespace surfeit {

Result<PictureFormat> pictureFormat(const std::string& path) {
  std::string ending = path.size() < 4 ? path : path.substr(path.size() - 4);
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  if (ending == ".png") return PictureFormat::kPng;
  if (ending == ".exr") return PictureFormat::kExr;
  return Status::invalidArgument(
      fmt::format("{}: cannot tell the picture format: expected a name in .png or .exr", path));
}

Status writePicture(const std::string& path, const Picture& picture, const PngOptions& png) {
  SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, format == PictureFormat::kPng
                                                                   ? encodePng(picture, png)
                                                                   : encodeExr(picture));
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  SURFEIT_RETURN_IF_ERROR(file.append(bytes));
  return file.commit();
}

}  // namespace surfeit
