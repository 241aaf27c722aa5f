// Indexes a small cloud, asks what the file holds and gathers from it, through the installed
// headers alone.
//
//   consumer DIR

#include <surfeit/gather.h>
#include <surfeit/index.h>
#include <surfeit/scene.h>
#include <surfeit/version.h>

#include <fstream>
#include <iostream>
#include <string>

namespace {

// Prints what the library tells.
class Notes : public surfeit::Progress {
 public:
  void note(const std::string& message) override { std::cout << message << '\n'; }
};

// A ceiling of 40 x 40 surfels, one unit above the origin, that faces down and sends light.
void writeCeiling(const std::string& path) {
  constexpr int kEdge = 40;
  std::ofstream file(path);
  file << "ply\nformat ascii 1.0\nelement vertex " << kEdge * kEdge
       << "\nproperty float x\nproperty float y\nproperty float z\n"
          "property float nx\nproperty float ny\nproperty float nz\n"
          "property float radius\nproperty float area\n"
          "property float radiosity_r\nproperty float radiosity_g\nproperty float radiosity_b\n"
          "end_header\n";
  for (int row = 0; row < kEdge; ++row) {
    for (int column = 0; column < kEdge; ++column) {
      const double x = (column + 0.5) / kEdge - 0.5, z = (row + 0.5) / kEdge - 0.5;
      file << x << " 1 " << z << " 0 -1 0 0.018 " << 1.0 / (kEdge * kEdge) << " 1 0.5 0.25\n";
    }
  }
}

void writeReceiver(const std::string& path) {
  std::ofstream file(path);
  file << "ply\nformat ascii 1.0\nelement vertex 1\n"
          "property float x\nproperty float y\nproperty float z\n"
          "property float nx\nproperty float ny\nproperty float nz\nend_header\n0 0 0 0 1 0\n";
}

int run(const std::string& directory) {
  const std::string cloud = directory + "/ceiling.ply", scene = directory + "/ceiling.sft";
  const std::string receivers = directory + "/receivers.ply", result = directory + "/result.ply";
  writeCeiling(cloud);
  writeReceiver(receivers);
  Notes progress;
  const auto fails = [](const surfeit::Status& status) {
    if (!status.ok()) std::cerr << status.message() << '\n';
    return !status.ok();
  };

  surfeit::IndexOptions index_options;
  index_options.memory_bytes = 64 << 20;
  const surfeit::Result<surfeit::IndexStats> index =
      surfeit::indexClouds({cloud}, scene, index_options, progress);
  if (fails(index.status())) return 1;

  const surfeit::Result<surfeit::SceneInfo> info = surfeit::readSceneInfo(scene);
  if (fails(info.status())) return 1;
  const surfeit::Result<surfeit::VerifyReport> report = surfeit::verifyScene(scene, 1, progress);
  if (fails(report.status())) return 1;

  surfeit::GatherOptions gather_options;
  gather_options.mode = surfeit::GatherMode::kBleeding;
  gather_options.memory_bytes = 64 << 20;
  const surfeit::Result<surfeit::GatherStats> gather =
      surfeit::gatherCloud(scene, receivers, result, gather_options, progress);
  if (fails(gather.status())) return 1;

  std::cout << "surfeit " << surfeit::kVersion << ": " << index->surfels << " surfels, "
            << info->nodes << " nodes, " << gather->receivers << " receiver\n";
  const bool ok = index->surfels == 1600 && info->surfels == 1600 && report->finding_count == 0 &&
                  gather->receivers == 1;
  if (!ok) std::cerr << "the library did not do what was asked of it\n";
  return ok ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: consumer DIR\n";
    return 2;
  }
  return run(argv[1]);
}
