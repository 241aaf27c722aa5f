// Reads back the EXR pictures that tests write.
#pragma once

#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>

#include <string>
#include <utility>
#include <vector>

namespace surfeit {

struct ExrPicture {
  int width = 0, height = 0;
  std::vector<float> r, g, b, a, z;

  std::size_t at(int x, int y) const { return std::size_t(y * width + x); }
};

inline ExrPicture readExr(const std::string& path) {
  Imf::InputFile file(path.c_str(), 0);
  ExrPicture picture;
  picture.width = file.header().dataWindow().max.x + 1;
  picture.height = file.header().dataWindow().max.y + 1;
  Imf::FrameBuffer buffer;
  for (const auto& [name, values] : {std::pair("R", &picture.r),
                                     {"G", &picture.g},
                                     {"B", &picture.b},
                                     {"A", &picture.a},
                                     {"Z", &picture.z}}) {
    values->resize(std::size_t(picture.width * picture.height));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values->data()),
                                   sizeof(float), sizeof(float) * std::size_t(picture.width)));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(0, picture.height - 1);
  return picture;
}

}  // namespace surfeit
