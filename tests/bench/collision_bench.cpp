// The search for collisions along the packaged dome: the machine's own bodies, ten more blocks and
// a mesh of 100 000 triangles. Beside it every pair looked at at every instant, on a piece of the
// program; and how the cost grows with the program and with the triangles.

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <fmt/ostream.h>

#include "sim/cut/bodies.h"
#include "sim/cut/collisions.h"
#include "sim/cut/job.h"
#include "sim/scene/read_scene.h"

namespace {

using namespace abbe;
namespace fs = std::filesystem;

/// A closed shell of waves about z, of about so many triangles, as a PLY.
void write_mesh(const fs::path& file, int triangles) {
  const int n = int(std::sqrt(triangles / 2.0));
  std::ofstream out(file);
  fmt::print(out,
             "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
             "property double z\nelement face {}\nproperty list uchar int vertex_indices\n"
             "end_header\n",
             n * n + 2, 2 * n * n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / n, z = 60.0 * (i + 0.5) / n;
      const double radius = 25.0 + 2.0 * std::sin(9.0 * angle) * std::sin(0.3 * z);
      fmt::print(out, "{:.6f} {:.6f} {:.6f}\n", radius * std::cos(angle), radius * std::sin(angle),
                 z);
    }
  fmt::print(out, "0 0 0\n0 0 60\n");
  for (int k = 0; k < n; ++k) {
    const int next = (k + 1) % n, last = n * (n - 1);
    for (int i = 0; i + 1 < n; ++i)
      fmt::print(out, "3 {0} {1} {2}\n3 {0} {2} {3}\n", i * n + k, i * n + next, (i + 1) * n + next,
                 (i + 1) * n + k);
    fmt::print(out, "3 {} {} {}\n3 {} {} {}\n", n * n, next, k, n * n + 1, last + k, last + next);
  }
}

/// @param share  of the program, by its step over
std::string scene_text(const fs::path& mesh, double step_over) {
  std::string text = fmt::format(
      "machine = \"{0}machines/gantry_cxyza.toml\"\nerrors = \"{0}errors/gantry_typical.toml\"\n"
      "[tool]\nkind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlength_mm = 120\n"
      "[tool.holder]\nradii_mm = [14, 20, 25]\nheights_mm = [45, 70, 115]\n"
      "[part]\nsurface = \"sphere_cap\"\nradius_mm = 100\nrim_radius_mm = 50\nat_mm = [40, 25, "
      "80]\n"
      "[program]\ngenerator = \"raster\"\nstep_over_mm = {1}\nstep_mm = 0.5\nlead_deg = 36\n"
      "feed_mm_per_min = 1500\nclearance_mm = 10\npattern = \"one_way\"\noverrun_mm = 1\n"
      "[[fixture]]\nname = \"vice\"\nshape = \"mesh\"\nfile = \"{2}\"\nat_mm = [-120, 0, 0]\n",
      std::string(ABBE_SOURCE_DIR) + "/scenes/", step_over, mesh.string());
  for (int k = 0; k < 7; ++k)
    text += fmt::format(
        "[[fixture]]\nname = \"clamp {0}\"\nsize_mm = [20, 20, 30]\nat_mm = [{1:.3f}, {2:.3f}, "
        "15]\n",
        k, 40 + 90 * std::cos(0.9 * k), 25 + 90 * std::sin(0.9 * k));
  return text;
}

struct Timed {
  sim::Collisions found;
  std::size_t blocks = 0, samples = 0;
};

Timed searched(const fs::path& folder, int triangles, double step_over) {
  write_mesh(folder / "vice.ply", triangles);
  std::ofstream(folder / "scene.toml") << scene_text(folder / "vice.ply", step_over);
  const sim::Job job = sim::prepare(sim::read_scene(folder / "scene.toml"));
  return {sim::collisions(job, sim::uncompensated_commands(job), "uncompensated"),
          job.path.blocks.size(), job.samples.states.size()};
}

void report(const char* what, const Timed& timed) {
  fmt::print(
      "{:<34}{:>8} blocks {:>8} samples {:>3} bodies {:>4} pairs {:>8} distances {:>8.2f} s"
      "  {:>7.1f} us a block\n",
      what, timed.blocks, timed.samples, timed.found.bodies.size(), timed.found.clearances.size(),
      timed.found.queries, timed.found.seconds, 1e6 * timed.found.seconds / double(timed.blocks));
}

/// Seconds that every pair at every instant would take, from a few of them.
void report_naive(const fs::path& folder, const Timed& all) {
  const sim::Job job = sim::prepare(sim::read_scene(folder / "scene.toml"));
  const std::vector<sim::SolidBody> solids = sim::segment_bodies(job, job);
  std::vector<cutting::Body> bodies;
  for (const sim::SolidBody& one : solids) bodies.push_back(cutting::make_body(one.mesh));
  const std::vector<cutting::BodyPair> pairs = sim::collision_pairs(job.truth.actual, solids, {});
  const std::size_t looks = 20;
  const auto start = std::chrono::steady_clock::now();
  double sum = 0.0;
  for (std::size_t k = 0; k < looks; ++k) {
    const auto& state = job.samples.states[k * (job.samples.states.size() - 1) / (looks - 1)];
    const auto T = sim::carrier_poses(job.truth.actual, state.q, {});
    for (const cutting::BodyPair& pair : pairs)
      sum += cutting::gap(
                 bodies[std::size_t(pair.a)], T[std::size_t(solids[std::size_t(pair.a)].frame)],
                 bodies[std::size_t(pair.b)], T[std::size_t(solids[std::size_t(pair.b)].frame)])
                 .distance;
  }
  const double each =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / looks;
  fmt::print(
      "{:<34}{:.3f} ms an instant, one thread: {:.0f} s for all of them, {:.0f} times as "
      "long (checksum {:.3f})\n",
      "every pair at every instant", 1e3 * each, each * double(all.samples),
      each * double(all.samples) / all.found.seconds, sum);
}

}  // namespace

int main() {
  const fs::path folder = fs::temp_directory_path() / "abbe_collision_bench";
  fs::create_directories(folder);
  const Timed all = searched(folder, 100000, 0.35);
  report("dome, mesh of 100 000 triangles", all);
  report_naive(folder, all);
  for (const int triangles : {1000, 10000, 1000000})
    report(fmt::format("mesh of {} triangles", triangles).c_str(),
           searched(folder, triangles, 0.35));
  for (const double step_over : {0.7, 1.4, 2.8})
    report(fmt::format("step over {} mm", step_over).c_str(), searched(folder, 100000, step_over));
  fs::remove_all(folder);
}
