#include "surfels/rows/dark_colors.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <vector>

#include "cloud/edits/color_sample.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {

Result<std::string> noteOfDarkColors(RowReader& reader) {
  const RowLayout& element = reader.element();
  if (element.count == 0) return std::string();
  // Colors that stand in for neither radiosity nor albedo are not used
  if (element.find(kRadiosityNames[0]) != nullptr && element.find(kAlbedoNames[0]) != nullptr) {
    return std::string();
  }
  ColorSample color;
  color.ends_with_light = true;
  for (const char* name : kColorNames) {
    const RowProperty* const property = element.find(name);
    if (property == nullptr || property->is_list) return std::string();
    color.properties.push_back(static_cast<std::size_t>(property - element.properties.data()));
    color.type = property->type;
  }
  std::vector<ColorSample> samples = {color};
  SURFEIT_ASSIGN_OR_RETURN(const bool is_whole, sampleColors(reader, samples));
  const ColorSample& seen = samples[0];
  const bool is_flag = seen.type == ValueType::kUint8 && seen.largest == 1;
  if (seen.hasLight() && !is_flag) return std::string();
  if (seen.largest != 0 && !is_flag) return std::string();  // not a number
  const std::string drops = dropsOf(element, "color");
  return fmt::format(
      "colors are {}{}: surfels are {}black{}; {} leaves the colors out",
      is_flag ? "0 or 1 in uchar, of 255" : "all 0", is_whole ? "" : " in a sample",
      is_flag ? "all but " : "",
      is_flag ? ", and `convert --set \"red = red * 255\"` (green, blue) makes 1 white" : "",
      drops.empty() ? "convert --drop color" : "--channels " + drops);
}

}  // namespace surfeit
