// What the example scenes are written with: Wavefront OBJ text of simple shapes, and files.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <string>

// Collects OBJ text; indices of OBJ files start at 1.
class ObjText {
 public:
  void line(const std::string& text) { text_ += text + "\n"; }

  // Opens a group of that name as well.
  void useMaterial(const std::string& name);

  // Counter-clockwise seen from the front.
  void quad(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d);

  // An axis-aligned box seen from outside, without the bottom that stands on the floor.
  void boxWithoutBottom(const glm::vec3& min, const glm::vec3& max);

  // An icosahedron with every triangle split in four `levels` times: triangles of nearly equal
  // size, and smooth normals.
  void sphere(const glm::vec3& centre, float radius, int levels);

  // A smooth surface over u and v in 0..1: `columns` x `rows` quads with normals along
  // d/du x d/dv, by differences; `point` must go on smoothly a little beyond 0 and 1.
  void surface(int columns, int rows, const std::function<glm::vec3(float u, float v)>& point);

  // The same around a curve, t in 0..1, no part of which runs along `aside`, as thick as `radius`
  // says. Its ends are open.
  void tube(int columns, int rows, const glm::vec3& aside,
            const std::function<glm::vec3(float t)>& curve,
            const std::function<float(float t)>& radius);

  const std::string& text() const { return text_; }

 private:
  void vertex(const glm::vec3& p);
  void normal(const glm::vec3& n);

  std::string text_;
  int vertices_ = 0, normals_ = 0;
};

// False, with a message on stderr, when the file cannot be written.
bool writeFile(const std::string& path, const std::string& bytes);
