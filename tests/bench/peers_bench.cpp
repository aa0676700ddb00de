// The exact surface beside its peers, on one task: time, memory and error against brute force, and
// how often each takes what the exact surface takes. Each runs in a process of its own.
//   peers_bench [side [vertices]]
// side: mm of the part (25; 100 is 40 401 poses and a million vertices, and takes half an hour);
// vertices: at how many the errors are looked at (1000).
// OpenVDB: apt-get install libopenvdb-dev, then configure again. NumPy: apt-get install
// python3-numpy.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "cutting/stock/stock.h"
#include "cutting/surface/surface.h"
#include "tests/bench/peers.h"
#include "tests/bench/wave.h"
#include "tests/oracles/brute_surface.h"

namespace abbe::bench {

double material_end(const std::function<double(const Eigen::Vector3d&)>& field,
                    const cutting::Design& design, Eigen::Index vertex, double step) {
  const Eigen::Vector3d origin = design.vertices.row(vertex), normal = design.normals.row(vertex);
  const auto at = [&](double s) { return field(origin + s * normal); };
  double in = -searched, value_in = at(in);
  if (!(value_in > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  for (double out = in + step; out <= searched; in = out, out += step) {
    const double value_out = at(out);
    if (value_out > 0.0) {
      value_in = value_out;
      continue;
    }
    for (int i = 0; i < 60 && out - in > 1e-9; ++i) {
      const double middle = 0.5 * (in + out);
      (at(middle) > 0.0 ? in : out) = middle;
    }
    return 0.5 * (in + out);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

namespace {

using Clock = std::chrono::steady_clock;
using Eigen::Vector3d;

constexpr double oracle_tolerance = 1e-6;  // mm

struct Size {
  double side = 25.0;  ///< mm
  int passes() const { return int(std::lround(side / 0.5)) + 1; }
  /// Nearly 0.1 mm apart, so that the grid of a peer lies on them nowhere for long.
  int per_side() const { return int(std::lround(side / 0.1)) - 3; }
};

PeerTask task_of(const std::string& name, const Size& size) {
  const bool ball = name == "ball";
  const cutting::Cutter cutter = ball ? cutting::Cutter{5, 5, 20} : cutting::Cutter{5, 1, 20};
  return {cutter,
          wave_motion(cutter, {.side = size.side, .passes = size.passes(), .upright = ball}),
          wave(size.side, size.per_side())};
}

Deviations exact_deviations(const PeerTask& task) {
  const cutting::Surface surface = cutting::milled_surface(task.design, task.cutter, task.motion,
                                                           {.band = searched, .progress = {}});
  return {surface.residual.begin(), surface.residual.end()};
}

Eigen::Isometry3d pose(const cutting::CutterMotion& motion, Eigen::Index i) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = motion.tip.row(i);
  T.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), motion.axis.row(i).transpose())
                   .toRotationMatrix();
  return T;
}

/// Dexels along z, as upright walls are not judged; cut on one thread.
Deviations dexel_deviations(const PeerTask& task, double spacing) {
  constexpr double margin = 1.0, under = 3.0, above = 3.0;  // mm
  const double side = task.motion.tip.col(1).maxCoeff();
  cutting::Stock stock = cutting::make_stock(
      cutting::BoxBlank{{-margin, -margin, -under}, {side + margin, side + margin, above}},
      Eigen::Isometry3d::Identity(), {.spacing = spacing, .three_directions = false});
  for (Eigen::Index i = 0; i + 1 < task.motion.tip.rows(); ++i)
    cutting::remove(stock, task.cutter,
                    {pose(task.motion, i), pose(task.motion, i + 1), int(i) + 1, false});
  Deviations found(std::size_t(task.design.vertices.rows()));
  tbb::parallel_for(std::size_t(0), found.size(), [&](std::size_t v) {
    const auto field = [&](const Vector3d& p) { return cutting::depth(stock, p); };
    found[v] = material_end(field, task.design, Eigen::Index(v), 0.5 * spacing);
  });
  return found;
}

struct Peer {
  const char* name;
  const char* shown;
  std::function<std::optional<Deviations>(const PeerTask&)> deviations;
  const char* absent = "";
};

const std::vector<Peer>& peers() {
  constexpr const char* get_openvdb = "not installed: apt-get install libopenvdb-dev";
  static const std::vector<Peer> all{
      {"exact", "exact surface", exact_deviations},
      {"dexels-0.1", "dexels 0.1 mm",
       [](const PeerTask& task) { return dexel_deviations(task, 0.1); }},
      {"dexels-0.05", "dexels 0.05 mm",
       [](const PeerTask& task) { return dexel_deviations(task, 0.05); }},
      {"openvdb-0.1", "OpenVDB 0.1 mm",
       [](const PeerTask& task) { return openvdb_deviations(task, 0.1); }, get_openvdb},
      {"openvdb-0.05", "OpenVDB 0.05 mm",
       [](const PeerTask& task) { return openvdb_deviations(task, 0.05); }, get_openvdb},
  };
  return all;
}

// What a process of a peer tells: three figures and the deviations, as doubles on its standard
// output; nothing where the peer is absent.

void write(const void* data, std::size_t doubles) {
  if (std::fwrite(data, sizeof(double), doubles, stdout) != doubles)
    throw std::runtime_error("cannot write the answer");
}

double cpu_seconds() {
  ::rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const ::timeval& t) {
    return double(t.tv_sec) + 1e-6 * double(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double resident_bytes() {
  std::ifstream sizes("/proc/self/statm");
  double all = 0.0, resident = 0.0;
  sizes >> all >> resident;
  return resident * double(::sysconf(_SC_PAGESIZE));
}

double peak_bytes() {
  ::rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * double(usage.ru_maxrss);
}

/// Resets the peak to what is resident now.
void forget_peak() { std::ofstream("/proc/self/clear_refs") << 5; }

int answer(const std::string& name, const PeerTask& task) {
  const auto peer = std::ranges::find(peers(), name, &Peer::name);
  if (peer == peers().end()) throw std::runtime_error("no peer " + name);
  forget_peak();
  const double before = resident_bytes(), cpu = cpu_seconds();
  const auto start = Clock::now();
  const std::optional<Deviations> found = peer->deviations(task);
  const std::chrono::duration<double> taken = Clock::now() - start;
  if (!found) return 77;
  const double figures[] = {taken.count(), cpu_seconds() - cpu, peak_bytes() - before};
  write(figures, std::size(figures));
  write(found->data(), found->size());
  return 0;
}

/// The task for a program in another language.
int write_task(const PeerTask& task, const Size& size) {
  const double head[] = {task.cutter.radius, task.cutter.corner_radius,
                         double(task.motion.tip.rows()), double(task.design.vertices.rows()),
                         double(size.per_side())};
  write(head, std::size(head));
  for (const cutting::Points* points :
       {&task.motion.tip, &task.motion.axis, &task.design.vertices, &task.design.normals})
    write(points->data(), std::size_t(points->size()));
  return 0;
}

struct Answer {
  double seconds = 0.0;
  double cpu_seconds = 0.0;
  double bytes = 0.0;
  Deviations deviations;
};

/// What a command answers; none where it says that it is absent.
std::optional<Answer> asked(const std::string& command) {
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("cannot run " + command);
  Deviations all;
  double block[4096];
  while (const std::size_t n = std::fread(block, sizeof(double), std::size(block), pipe))
    all.insert(all.end(), block, block + n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) return std::nullopt;
  if (status != 0 || all.size() < 3) throw std::runtime_error("failed: " + command);
  return Answer{all[0], all[1], all[2], {all.begin() + 3, all.end()}};
}

/// The samples of a pass, and the first of the next: the way there cuts as well.
struct Range {
  Eigen::Index first, last;
};
std::vector<Range> passes_of(int passes) {
  std::vector<Range> all;
  for (Eigen::Index j = 0; j < passes; ++j)
    all.push_back({j * passes, std::min<Eigen::Index>((j + 1) * passes, passes * passes - 1)});
  return all;
}

/// Vertices and where the surface is there, mm, proved to the oracle's tolerance.
struct Truth {
  std::vector<std::size_t> vertices;
  std::vector<double> s;
  double bound = 0.0;  ///< mm, the widest
};

/// The poses of a pass whose moves can come within the band of a vertex.
std::vector<oracles::BrutePose> near_poses(const PeerTask& task, const Range& pass,
                                           const Vector3d& origin) {
  const double reach = std::hypot(task.cutter.radius, task.cutter.flank_length) + searched;
  constexpr double longest_move = 1.0;  // mm
  std::vector<oracles::BrutePose> poses;
  for (Eigen::Index i = pass.first; i <= pass.last; ++i) {
    const Vector3d tip = task.motion.tip.row(i);
    if ((tip - origin).norm() > reach + longest_move) continue;
    poses.push_back({tip, task.motion.axis.row(i), task.motion.time_s[i]});
  }
  return poses;
}

/// Brute force pass by pass, the nearest first: it rules out what is later than itself.
oracles::BruteHit brute(const PeerTask& task, std::vector<Range> passes, Eigen::Index vertex) {
  const Vector3d origin = task.design.vertices.row(vertex);
  const auto away = [&](const Range& pass) {
    const double y = 0.5 * (task.motion.tip(pass.first, 1) + task.motion.tip(pass.last, 1));
    return std::abs(y - origin.y());
  };
  std::ranges::sort(passes, {}, away);
  oracles::BruteHit least{.s = std::numeric_limits<double>::infinity()};
  for (const Range& pass : passes) {
    const std::vector<oracles::BrutePose> poses = near_poses(task, pass, origin);
    if (poses.size() < 2) continue;
    const double band = std::min(searched, std::abs(least.s) + oracle_tolerance);
    const oracles::BruteHit hit = oracles::brute_milled(
        {origin, task.design.normals.row(vertex)},
        {task.cutter.radius, task.cutter.corner_radius, task.cutter.flank_length}, poses,
        {.band = band, .tolerance = oracle_tolerance});
    if (hit.cut && hit.s < least.s) least = hit;
  }
  return least;
}

Truth truth_of(const PeerTask& task, int passes, std::size_t looked_at) {
  std::mt19937_64 random(20261126);
  Truth truth;
  std::vector<std::size_t> all(std::size_t(task.design.vertices.rows()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  std::ranges::sample(all, std::back_inserter(truth.vertices), looked_at, random);
  truth.s.resize(truth.vertices.size());
  std::vector<double> bound(truth.s.size());
  const std::vector<Range> ranges = passes_of(passes);
  tbb::parallel_for(std::size_t(0), truth.s.size(), [&](std::size_t k) {
    const oracles::BruteHit hit = brute(task, ranges, Eigen::Index(truth.vertices[k]));
    truth.s[k] = hit.s;
    bound[k] = hit.bound;
  });
  truth.bound = *std::ranges::max_element(bound);
  return truth;
}

struct Errors {
  double max = 0.0;  ///< mm
  double rms = 0.0;
  std::size_t missing = 0;  ///< of the sampled vertices: nothing found there
};

Errors errors_of(const Deviations& found, const Truth& truth) {
  Errors errors;
  double squares = 0.0;
  for (std::size_t k = 0; k < truth.s.size(); ++k) {
    const double error = std::abs(found.at(truth.vertices[k]) - truth.s[k]);
    if (!std::isfinite(error)) {
      ++errors.missing;
      continue;
    }
    errors.max = std::max(errors.max, error);
    squares += error * error;
  }
  errors.rms =
      std::sqrt(squares / double(std::max<std::size_t>(1, truth.s.size() - errors.missing)));
  return errors;
}

void print_row(const char* shown, const Answer& one, const Errors& errors, const Answer& ours) {
  fmt::print("{:<16} {:8.2f} {:8.2f} {:9.1f} {:10.2g} {:10.2g} {:8.1f} {:8.1f} {:8.1f}", shown,
             one.seconds, one.cpu_seconds, one.bytes / 1e6, errors.max / units::um,
             errors.rms / units::um, one.seconds / ours.seconds, one.cpu_seconds / ours.cpu_seconds,
             one.bytes / ours.bytes);
  if (errors.missing > 0) fmt::print("  nothing found at {} of them", errors.missing);
  fmt::print("\n");
  std::fflush(stdout);
}

void compare(const std::string& name, const Size& size, std::size_t looked_at) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  const PeerTask task = task_of(name, size);
  const Truth truth = truth_of(task, size.passes(), looked_at);
  fmt::print(
      "\n{} R {:g} r {:g}: {} moves, {} vertices, {:g} x {:g} mm; errors at {} of them, known to "
      "{:.2g} um\n{:<16} {:>8} {:>8} {:>9} {:>10} {:>10} {:>8} {:>8} {:>8}\n",
      name, task.cutter.radius, task.cutter.corner_radius, task.motion.tip.rows() - 1,
      task.design.vertices.rows(), size.side, size.side, truth.vertices.size(),
      truth.bound / units::um, "", "s", "cpu s", "MB", "max um", "rms um", "s x", "cpu x", "MB x");
  const auto row = [&](const char* shown, const std::string& command, const char* absent,
                       const std::optional<Answer>& ours) {
    const std::optional<Answer> one = asked(command);
    if (one) print_row(shown, *one, errors_of(one->deviations, truth), ours ? *ours : *one);
    if (!one) fmt::print("{:<16} {}\n", shown, absent);
    return one;
  };
  const std::string asks = fmt::format(" {} {:g}", name, size.side);
  std::optional<Answer> ours;
  for (const Peer& peer : peers()) {
    const auto one = row(peer.shown, fmt::format("'{}' --peer {}{}", program, peer.name, asks),
                         peer.absent, ours);
    if (!ours) ours = one;
  }
  row("NumPy z-map",
      fmt::format("'{}' --write{} | /usr/bin/python3 {}/tests/bench/peers_zmap.py", program, asks,
                  ABBE_SOURCE_DIR),
      "not installed: apt-get install python3-numpy", ours);
}

int run(const std::vector<std::string>& words) {
  const auto size_in = [&](std::size_t at) {
    const Size size{words.size() > at ? std::stod(words[at]) : Size{}.side};
    if (!(size.side >= 5.0 && size.side <= 1000.0))
      throw std::runtime_error("expected a side of 5 to 1000 mm");
    return size;
  };
  if (words.size() > 2 && words[0] == "--peer")
    return answer(words[1], task_of(words[2], size_in(3)));
  if (words.size() > 1 && words[0] == "--write")
    return write_task(task_of(words[1], size_in(2)), size_in(2));
  const std::size_t looked_at = words.size() > 1 ? std::stoul(words[1]) : 1000;
  for (const char* name : {"ball", "bull-nose"}) compare(name, size_in(0), looked_at);
  return 0;
}

}  // namespace
}  // namespace abbe::bench

int main(int argc, char** argv) {
  try {
    return abbe::bench::run({argv + 1, argv + argc});
  } catch (const std::exception& failure) {
    fmt::print(stderr, "peers_bench: {}\n", failure.what());
    return 1;
  }
}
