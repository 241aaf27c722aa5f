#include "sample/meshes/obj_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

constexpr double kNoLimit = std::numeric_limits<float>::max() / 4;  // pi times it is a float

std::string textOf(const double (&rgb)[3]) {
  return fmt::format("{:g} {:g} {:g}", rgb[0], rgb[1], rgb[2]);
}

// Whether a color that must not exceed 1 counts to 255: whole numbers, as large as of the colors of
// clouds and vertices.
bool isCode(const double (&rgb)[3]) {
  constexpr double kLeast = 16, kMost = 255;
  const double largest = *std::max_element(std::begin(rgb), std::end(rgb));
  return largest >= kLeast && largest <= kMost &&
         std::all_of(std::begin(rgb), std::end(rgb),
                     [](double value) { return value >= 0 && value == std::floor(value); });
}

}  // namespace

ObjMaterials::ObjMaterials(const std::string& path, const std::vector<tinyobj::material_t>& parsed,
                           const std::map<std::string, MaterialSource>& sources,
                           const Material& plain, Mesh& mesh, Progress& progress)
    : path_(path),
      parsed_(parsed),
      mesh_(mesh),
      progress_(progress),
      begin_(std::uint32_t(mesh.materials.size())) {
  mesh.materials.push_back(plain);
  for (std::size_t i = 0; i < parsed.size(); ++i) {
    const auto source = sources.find(parsed[i].name);
    import(int(i), source != sources.end() ? source->second : MaterialSource{{}, true});
  }
}

std::uint32_t ObjMaterials::ofFace(int id, bool has_uv) {
  if (!has(id)) return begin_;
  const std::uint32_t index = begin_ + 1 + std::uint32_t(id);
  const auto found = bare_.find(id);
  if (found == bare_.end()) return index;
  Bare& bare = found->second;
  ++bare.faces_of_all;
  if (has_uv) return index;
  ++bare.faces;
  if (bare.index == 0) {
    bare.index = std::uint32_t(mesh_.materials.size());
    mesh_.materials.push_back(bare.material);
  }
  return bare.index;
}

void ObjMaterials::noteFacesWithoutUv() const {
  for (const auto& [id, bare] : bare_) {
    if (bare.faces == 0) continue;
    const tinyobj::material_t& parsed = parsed_[std::size_t(id)];
    const Material& material = mesh_.materials[begin_ + 1 + std::uint32_t(id)];
    std::string maps;
    const auto add = [&maps](const char* map) {
      maps += (maps.empty() ? "" : ", ") + std::string(map);
    };
    if (material.texture != kNoTexture) add("map_Kd");
    if (material.glow != kNoTexture) add("map_Ke");
    if (material.mask != kNoTexture) add("map_d");
    progress_.note(
        fmt::format("{}: {} of {} faces of material \"{}\" have no texture coordinates: they get "
                    "its Kd, Ke and d without {} (unwrap the mesh)",
                    path_, bare.faces, bare.faces_of_all, shown(parsed.name), maps));
  }
}

void ObjMaterials::import(int id, const MaterialSource& source) {
  const tinyobj::material_t& parsed = parsed_[std::size_t(id)];
  Material material;
  if (source.has_kd) material.albedo = reflectanceOf(parsed);
  material.emission = float(kPi) * colorOf(parsed, "Ke", parsed.emission, kNoLimit);
  // Written so that NaN is opaque
  const float dissolve = parsed.dissolve < 1 ? float(std::max(parsed.dissolve, 0.0)) : 1;
  if (!(parsed.dissolve >= 0 && parsed.dissolve <= 1)) {
    note(parsed, fmt::format("has d {:g} (or Tr {:g}): read as d {:g}, expected 0 to 1",
                             parsed.dissolve, 1 - parsed.dissolve, dissolve));
  }
  const glm::vec3 filter = colorOf(parsed, "Tf", parsed.transmittance, 1);
  const bool has_filter = filter != glm::vec3(0) && filter != glm::vec3(1);
  if (has_filter) material.transmission = filter;
  // What d lets through is filtered
  material.opacity = has_filter ? 1.f - (1 - dissolve) * filter : glm::vec3(dissolve);
  importScattering(parsed, has_filter && dissolve == 1, material);

  Material bare = material;
  importPictures(parsed, source.directory, material);
  if (!source.has_kd) {
    bare.albedo = mesh_.materials[begin_].albedo;
    importWithoutKd(parsed, material);
  }
  if (material.opacity == glm::vec3(0)) {
    note(parsed, "is clear (d 0 or Tr 1): its faces give no surfels and shade nothing");
  }
  mesh_.materials.push_back(material);
  const bool has_picture =
      material.texture != kNoTexture || material.glow != kNoTexture || material.mask != kNoTexture;
  if (has_picture) bare_[id].material = bare;
}

void ObjMaterials::note(const tinyobj::material_t& material, const std::string& text) const {
  progress_.note(fmt::format("{}: material \"{}\" {}", path_, shown(material.name), text));
}

// The numbers of a color, from 0 to `most`; the others are told.
glm::vec3 ObjMaterials::colorOf(const tinyobj::material_t& parsed, const char* statement,
                                const double (&rgb)[3], double most) const {
  glm::vec3 color(0);
  bool is_cut = false;
  for (int i = 0; i < 3; ++i) {
    is_cut = is_cut || !(rgb[i] >= 0 && rgb[i] <= most);
    if (rgb[i] > 0) color[i] = float(std::min(rgb[i], most));
  }
  if (is_cut) {
    note(parsed,
         fmt::format("has {} {}: read as {:g} {:g} {:g}, expected {}", statement, textOf(rgb),
                     color.r, color.g, color.b, most == 1 ? "0 to 1" : "0 or more"));
  }
  return color;
}

glm::vec3 ObjMaterials::reflectanceOf(const tinyobj::material_t& parsed) const {
  const double(&kd)[3] = parsed.diffuse;
  if (isCode(kd)) {
    note(parsed,
         fmt::format("has Kd {}: read as sRGB of 8 bits (Kd is linear, from 0 to 1)", textOf(kd)));
    glm::vec3 color;
    for (int i = 0; i < 3; ++i) color[i] = linearFromSrgb8(std::uint8_t(kd[i]));
    return color;
  }
  const glm::vec3 color = colorOf(parsed, "Kd", kd, kNoLimit);
  if (std::max({color.r, color.g, color.b}) > 1) {
    note(parsed, fmt::format("has Kd {}, which is above 1: it reflects more light than it gets "
                             "(write 0 to 1)",
                             textOf(kd)));
  }
  return color;
}

// Illumination models of MTL: 3, 5 and 8 reflect, 4, 6, 7 and 9 refract. Others let through Tf
// where it says more than the default of exporters, which is all or nothing, and nothing is let
// through by d.
void ObjMaterials::importScattering(const tinyobj::material_t& parsed, bool is_translucent,
                                    Material& material) {
  const bool reflects = parsed.illum == 3 || parsed.illum == 5 || parsed.illum == 8;
  const bool refracts =
      parsed.illum == 4 || parsed.illum == 6 || parsed.illum == 7 || parsed.illum == 9;
  if (reflects) {
    material.scattering = Scattering::kMirror;
    material.specular = colorOf(parsed, "Ks", parsed.specular, 1);
    return;
  }
  if (!refracts) {
    if (is_translucent) material.scattering = Scattering::kTranslucent;
    return;
  }
  material.scattering = Scattering::kGlass;
  if (parsed.ior > 1 && parsed.ior < 10) {
    material.index = float(parsed.ior);
  } else {
    note(parsed, fmt::format("refracts (illum {}) with Ni {}: read as {}", parsed.illum, parsed.ior,
                             material.index));
  }
}

// What a picture of emission multiplies is Ke; files that say only map_Ke mean the picture alone.
void ObjMaterials::importPictures(const tinyobj::material_t& parsed, const std::string& directory,
                                  Material& material) {
  material.texture = findPicture(parsed.diffuse_texname, parsed.diffuse_texopt, directory,
                                 mesh_.textures, textures_);
  material.glow = findPicture(parsed.emissive_texname, parsed.emissive_texopt, directory,
                              mesh_.textures, textures_);
  if (material.glow != kNoTexture && material.emission == glm::vec3(0)) {
    material.emission = glm::vec3(kPi);
    note(parsed,
         "has map_Ke and no Ke: read as Ke 1 1 1, a radiance of 1 where the picture is white");
  }
  material.mask =
      findPicture(parsed.alpha_texname, parsed.alpha_texopt, directory, mesh_.masks, masks_);
}

// What a picture of colors multiplies is Kd. Without either a surface that neither shines, mirrors
// nor refracts is none without a material.
void ObjMaterials::importWithoutKd(const tinyobj::material_t& parsed, Material& material) {
  if (!parsed.diffuse_texname.empty()) {
    material.albedo = glm::vec3(1);
    note(parsed, "has map_Kd and no Kd: read as Kd 1 1 1");
    return;
  }
  material.albedo = glm::vec3(0);
  if (material.opacity == glm::vec3(0) || material.emission != glm::vec3(0) ||
      material.scattering == Scattering::kMirror || material.scattering == Scattering::kGlass) {
    return;
  }
  material.albedo = mesh_.materials[begin_].albedo;
  note(parsed, "has no Kd: it has the color of what has no material (--albedo)");
}

// Index of the picture of that name, of a material file in `directory`; one that cannot be read is
// told once and left out.
template <typename Picture>
std::uint32_t ObjMaterials::findPicture(const std::string& name,
                                        const tinyobj::texture_option_t& options,
                                        const std::string& directory,
                                        std::vector<Picture>& pictures,
                                        std::map<std::string, std::uint32_t>& known) {
  if (name.empty()) return kNoTexture;
  const std::string of_options = noteOfOptions(name, options);
  if (!of_options.empty()) progress_.note(path_ + ": " + of_options);
  const std::string path = findPictureFile(name, {directoryOf(path_), directory});
  const auto [found, is_new] = known.try_emplace(path, kNoTexture);
  if (!is_new) return found->second;
  Result<Picture> loaded = Picture::load(path);
  if (!loaded.ok()) {
    progress_.note(fmt::format("{}: texture left out: {}", path_, loaded.status().message()));
    return kNoTexture;
  }
  if constexpr (std::is_same_v<Picture, Texture>) {
    if (loaded->hasAlpha()) {
      progress_.note(fmt::format(
          "{}: the alpha of texture {} is not used: map_d {} in the material cuts by it", path_,
          name, name));
    }
  }
  found->second = std::uint32_t(pictures.size());
  pictures.push_back(std::move(*loaded));
  return found->second;
}

}  // namespace surfeit
