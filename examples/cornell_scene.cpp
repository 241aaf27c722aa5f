// Writes a demo scene, cornell.obj and cornell.mtl: a box with a red and a green wall, a light
// below the ceiling, a sphere on the floor and one on a small box.
//
//   cornell_scene DIR
//   surfeit sample DIR/cornell.obj -o cornell.ply --count 1000000

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

// Collects OBJ text; indices of OBJ files start at 1.
class ObjText {
 public:
  void line(const std::string& text) { text_ += text + "\n"; }

  void useMaterial(const std::string& name) {
    line("g " + name);
    line("usemtl " + name);
  }

  // Counter-clockwise seen from the front.
  void quad(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d) {
    const int base = vertices_;
    for (const glm::vec3& corner : {a, b, c, d}) vertex(corner);
    line(fmt::format("f {} {} {} {}", base + 1, base + 2, base + 3, base + 4));
  }

  // An axis-aligned box seen from outside, without the bottom that stands on the floor.
  void boxWithoutBottom(const glm::vec3& min, const glm::vec3& max) {
    const auto corner = [&](int x, int y, int z) {
      return glm::vec3(x ? max.x : min.x, y ? max.y : min.y, z ? max.z : min.z);
    };
    quad(corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1));
    quad(corner(1, 0, 0), corner(0, 0, 0), corner(0, 1, 0), corner(1, 1, 0));
    quad(corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), corner(0, 1, 0));
    quad(corner(1, 0, 1), corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1));
    quad(corner(0, 1, 1), corner(1, 1, 1), corner(1, 1, 0), corner(0, 1, 0));
  }

  // An icosahedron with every triangle split in four `levels` times: triangles of nearly equal
  // size, and smooth normals.
  void sphere(const glm::vec3& centre, float radius, int levels);

  const std::string& text() const { return text_; }

 private:
  void vertex(const glm::vec3& p) {
    line(fmt::format("v {:.7g} {:.7g} {:.7g}", p.x, p.y, p.z));
    ++vertices_;
  }

  std::string text_;
  int vertices_ = 0, normals_ = 0;
};

void ObjText::sphere(const glm::vec3& centre, float radius, int levels) {
  // Corners of three golden rectangles
  constexpr float kGolden = 1.618034f;
  std::vector<glm::vec3> directions;
  for (const float a : {-1.0f, 1.0f}) {
    for (const float b : {-kGolden, kGolden}) {
      directions.emplace_back(a, b, 0.0f);
      directions.emplace_back(0.0f, a, b);
      directions.emplace_back(b, 0.0f, a);
    }
  }
  for (glm::vec3& direction : directions) direction = glm::normalize(direction);

  // Its faces are the triples at edge length; turned so that they face outwards
  using Face = std::array<std::uint32_t, 3>;
  std::vector<Face> faces;
  const auto isEdge = [&](std::uint32_t i, std::uint32_t k) {
    return glm::distance(directions[i], directions[k]) < 1.1f;  // edges 1.05, diagonals 1.70
  };
  for (std::uint32_t i = 0; i < 12; ++i) {
    for (std::uint32_t j = i + 1; j < 12; ++j) {
      for (std::uint32_t k = j + 1; k < 12; ++k) {
        if (!isEdge(i, j) || !isEdge(j, k) || !isEdge(i, k)) continue;
        const glm::vec3 normal =
            glm::cross(directions[j] - directions[i], directions[k] - directions[i]);
        const bool is_outward = glm::dot(normal, directions[i]) > 0;
        faces.push_back(is_outward ? Face{i, j, k} : Face{i, k, j});
      }
    }
  }

  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t i, std::uint32_t k) {
      const auto [found, is_new] =
          middles.try_emplace(std::minmax(i, k), std::uint32_t(directions.size()));
      if (is_new) directions.push_back(glm::normalize(directions[i] + directions[k]));
      return found->second;
    };
    std::vector<Face> finer;
    for (const Face& f : faces) {
      const std::uint32_t a = middle(f[0], f[1]), b = middle(f[1], f[2]), c = middle(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], a, c}, {a, f[1], b}, {c, b, f[2]}, {a, b, c}});
    }
    faces = std::move(finer);
  }

  const int vertex_base = vertices_ + 1, normal_base = normals_ + 1;
  for (const glm::vec3& d : directions) {
    vertex(centre + radius * d);
    line(fmt::format("vn {:.6g} {:.6g} {:.6g}", d.x, d.y, d.z));
    ++normals_;
  }
  for (const Face& face : faces) {
    std::string text = "f";
    for (const std::uint32_t corner : face) {
      text += fmt::format(" {}//{}", vertex_base + int(corner), normal_base + int(corner));
    }
    line(text);
  }
}

std::string sceneText() {
  ObjText obj;
  obj.line("# Cornell box with two spheres; units: the box is 1 wide, +y up, open towards +z.");
  obj.line("# Camera: eye 0.5 0.5 2.4, looking at 0.5 0.5 0, up 0 1 0, vertical field of view 37.");
  obj.line("mtllib cornell.mtl");

  // Walls face inwards
  obj.useMaterial("white");
  obj.quad({0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0});  // floor
  obj.quad({0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1});  // ceiling
  obj.quad({0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0});  // back
  obj.useMaterial("red");
  obj.quad({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1});  // left
  obj.useMaterial("green");
  obj.quad({1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0});  // right
  obj.useMaterial("light");
  obj.quad({0.35f, 0.98f, 0.35f}, {0.65f, 0.98f, 0.35f}, {0.65f, 0.98f, 0.65f},
           {0.35f, 0.98f, 0.65f});  // faces down

  // 20,480 triangles each: facets far smaller than a pixel of a usual picture
  constexpr int kSphereLevels = 5;
  obj.useMaterial("white");
  obj.boxWithoutBottom({0.14f, 0, 0.16f}, {0.46f, 0.3f, 0.48f});
  obj.sphere({0.3f, 0.46f, 0.32f}, 0.16f, kSphereLevels);  // rests on the box
  obj.useMaterial("blue");
  obj.sphere({0.7f, 0.2f, 0.62f}, 0.2f, kSphereLevels);  // rests on the floor
  return obj.text();
}

constexpr const char* kMaterials = R"(newmtl white
Kd 0.73 0.73 0.73

newmtl red
Kd 0.63 0.065 0.05

newmtl green
Kd 0.14 0.45 0.091

newmtl blue
Kd 0.3 0.35 0.6

newmtl light
Kd 0.5 0.5 0.5
Ke 17 15 12
)";

bool writeText(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) fmt::print(stderr, "cornell_scene: {}: cannot be written\n", path);
  return bool(file);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: cornell_scene DIR\n");
    return 2;
  }
  const std::string directory = argv[1];
  const bool ok = writeText(directory + "/cornell.mtl", kMaterials) &&
                  writeText(directory + "/cornell.obj", sceneText());
  return ok ? 0 : 1;
}
