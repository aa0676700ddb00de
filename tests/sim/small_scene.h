#pragma once

#include <random>
#include "sim/loop/compensate.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

/// Small versions of scenes, cut in a moment, and maps held against other maps and closed forms.
namespace abbe::sim {

inline fs::path packaged(const std::string& name) {
  return fs::path(ABBE_SOURCE_DIR) / "scenes" / name;
}

/// File names of all packaged scenes, in their order.
inline std::vector<std::string> packaged_scenes() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(packaged("")))
    if (entry.path().extension() == ".toml") names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// A packaged scene with changes, compiled.
inline Job job_of(const std::string& name, const std::vector<Override>& changes = {}) {
  return prepare(read_scene(packaged(name), changes));
}

/// A job of one tool, divided into windows of one to three blocks.
inline Job in_random_windows(Job job, std::mt19937_64& random) {
  Windows windows;
  program::SampleWindow blocks;
  const std::size_t count = job.path.blocks.size();
  while (blocks.first < count) {
    blocks.last = std::min(count, blocks.first + 1 + random() % 3);
    windows.all.push_back({0, blocks});
    program::SampleOptions sampling = job.sampling;
    sampling.continued_from = blocks.continued_from;
    const program::Samples samples =
        program::sample(program::path_of(job.path, blocks), job.machine.nominal, sampling);
    blocks = {blocks.last, 0, program::SamplingState{samples.states.back(), samples.moved}};
  }
  job.windows = std::make_shared<const Windows>(std::move(windows));
  return job;
}

inline constexpr double ball_radius = 5.0;  // mm, of tools/ball_r5.toml

/// A small part under a ball end mill R 5, one way, as a scene of its own.
struct BallRaster {
  std::string part;  ///< TOML lines of [part], vertices with them
  double step_over = 0.5;
  double step = 0.5;
  double lead = 36.0;  ///< deg
  std::string machine = "gantry_cxyza";
  std::string more = {};  ///< TOML sections after all others
};

inline std::string to_toml(const BallRaster& scene) {
  const std::string scenes = packaged("").string();
  return fmt::format(
      "machine = \"{0}machines/{1}.toml\"\n"
      "tool = \"{0}tools/ball_r5.toml\"\n"
      "[part]\n{2}\n"
      "[program]\ngenerator = \"raster\"\npattern = \"one_way\"\nclearance_mm = 10\noverrun_mm = "
      "1\n"
      "step_over_mm = {3}\nstep_mm = {4}\nlead_deg = {5}\n{6}",
      scenes, scene.machine, scene.part, scene.step_over, scene.step, scene.lead, scene.more);
}

inline Scene scene_of(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  const SceneFolder folder;
  return read_scene(folder.write("ball.toml", to_toml(raster)), changes);
}

inline Job job_of(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  return prepare(scene_of(raster, changes));
}

/// How far apart maps are, mm, every vertex counting one.
struct Apart {
  double rms = 0.0;
  double max = 0.0;
  int vertices = 0;  ///< cut in both
  int unlike = 0;    ///< cut in one only
};

inline Apart apart(const cutting::Surface& a, const cutting::Surface& b) {
  Apart d;
  for (std::size_t i = 0; i < a.status.size(); ++i) {
    const bool in_a = a.status[i] == cutting::VertexStatus::Cut;
    const bool in_b = b.status[i] == cutting::VertexStatus::Cut;
    if (in_a != in_b) ++d.unlike;
    if (!in_a || !in_b) continue;
    const double by = std::abs(a.residual[Index(i)] - b.residual[Index(i)]);
    d.rms += by * by;
    d.max = std::max(d.max, by);
    ++d.vertices;
  }
  d.rms = std::sqrt(d.rms / std::max(1, d.vertices));
  return d;
}

/// A vertex that was cut, in the frame of the part.
struct CutVertex {
  Vector3d p;
  Vector3d n;
  double residual;
};

inline std::vector<CutVertex> cut_vertices(const Job& job, const cutting::Surface& surface) {
  const kinematics::Pose T_mw = job.scene.part.T_wm.inverse();
  std::vector<CutVertex> all;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    if (surface.status[i] != cutting::VertexStatus::Cut) continue;
    const Index k = Index(i);
    all.push_back({T_mw * Vector3d(job.design_w.vertices.row(k).transpose()),
                   T_mw.linear() * Vector3d(job.design_w.normals.row(k).transpose()),
                   surface.residual[k]});
  }
  return all;
}

/// Residuals less what a closed form says of their vertices; NaN leaves a vertex out.
struct Misfit {
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
  int vertices = 0;
  double magnitude() const { return std::max(std::abs(least), std::abs(most)); }
};

inline Misfit misfit(const Job& job, const cutting::Surface& surface,
                     const std::function<double(const CutVertex&)>& expected) {
  Misfit m;
  for (const CutVertex& vertex : cut_vertices(job, surface)) {
    const double by = vertex.residual - expected(vertex);
    if (std::isnan(by)) continue;
    m.least = std::min(m.least, by);
    m.most = std::max(m.most, by);
    ++m.vertices;
  }
  return m;
}

/// Rest of a division to the nearest multiple: how far a vertex lies from its pass.
inline double off_grid(double y, double step) { return std::remainder(y, step); }

}  // namespace abbe::sim
