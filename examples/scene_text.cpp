#include "scene_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <utility>
#include <vector>

void ObjText::useMaterial(const std::string& name) {
  line("g " + name);
  line("usemtl " + name);
}

void ObjText::vertex(const glm::vec3& p) {
  line(fmt::format("v {:.7g} {:.7g} {:.7g}", p.x, p.y, p.z));
  ++vertices_;
}

void ObjText::normal(const glm::vec3& n) {
  line(fmt::format("vn {:.6g} {:.6g} {:.6g}", n.x, n.y, n.z));
  ++normals_;
}

void ObjText::quad(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d) {
  const int base = vertices_;
  for (const glm::vec3& corner : {a, b, c, d}) vertex(corner);
  line(fmt::format("f {} {} {} {}", base + 1, base + 2, base + 3, base + 4));
}

void ObjText::boxWithoutBottom(const glm::vec3& min, const glm::vec3& max) {
  const auto corner = [&](int x, int y, int z) {
    return glm::vec3(x ? max.x : min.x, y ? max.y : min.y, z ? max.z : min.z);
  };
  quad(corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1));
  quad(corner(1, 0, 0), corner(0, 0, 0), corner(0, 1, 0), corner(1, 1, 0));
  quad(corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), corner(0, 1, 0));
  quad(corner(1, 0, 1), corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1));
  quad(corner(0, 1, 1), corner(1, 1, 1), corner(1, 1, 0), corner(0, 1, 0));
}

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
    normal(d);
  }
  for (const Face& face : faces) {
    std::string text = "f";
    for (const std::uint32_t corner : face) {
      text += fmt::format(" {}//{}", vertex_base + int(corner), normal_base + int(corner));
    }
    line(text);
  }
}

void ObjText::surface(int columns, int rows,
                      const std::function<glm::vec3(float u, float v)>& point) {
  constexpr float kStep = 1e-3f;
  const int vertex_base = vertices_ + 1, normal_base = normals_ + 1;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const float u = float(column) / float(columns), v = float(row) / float(rows);
      // Just inside the ends, where a surface may close in a point
      const float at = std::clamp(v, 2 * kStep, 1 - 2 * kStep);
      const glm::vec3 along_u = point(u + kStep, at) - point(u - kStep, at);
      const glm::vec3 along_v = point(u, at + kStep) - point(u, at - kStep);
      vertex(point(u, v));
      normal(glm::normalize(glm::cross(along_u, along_v)));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int first = row * (columns + 1) + column;
      std::string text = "f";
      for (const int corner : {first, first + 1, first + columns + 2, first + columns + 1}) {
        text += fmt::format(" {}//{}", vertex_base + corner, normal_base + corner);
      }
      line(text);
    }
  }
}

void ObjText::tube(int columns, int rows, const glm::vec3& aside,
                   const std::function<glm::vec3(float t)>& curve,
                   const std::function<float(float t)>& radius) {
  constexpr float kTurn = 6.2831853f, kStep = 1e-3f;
  surface(columns, rows, [&](float u, float v) {
    const glm::vec3 forward = glm::normalize(curve(v + kStep) - curve(v - kStep));
    const glm::vec3 side = glm::normalize(glm::cross(forward, aside));
    const glm::vec3 up = glm::cross(side, forward);
    return curve(v) + radius(v) * (std::cos(kTurn * u) * side - std::sin(kTurn * u) * up);
  });
}

bool writeFile(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  file.close();
  if (!file) fmt::print(stderr, "{}: cannot be written\n", path);
  return bool(file);
}
