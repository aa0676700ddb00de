#include "sim/program/rewrite.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/program/program_writers.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {

namespace {

using Eigen::Vector2d;
using kinematics::AxisVector;
using kinematics::Motion;
using Points = std::vector<CorrectedPoint>;

// Beyond 0.9 half turns the middle of an arc depends strongly on the rounding of its centre, and a
// full circle could not be distinguished from no motion.
constexpr double max_sweep = 0.9 * pi;
// Steps of a word; below it rounding distorts the radius by more than 1 %.
constexpr double min_radius_words = 50.0;
// Steps of a word; the direction of a shorter chord is dominated by rounding.
constexpr double min_chord_words = 20.0;

void check_dense(const Path& path, std::span<const Points> dense) {
  if (dense.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < dense.size(); ++i) {
    if (dense[i].empty()) continue;
    double last = 0.0;
    for (const CorrectedPoint& point : dense[i]) {
      if (!(point.u >= last && point.u <= 1.0) || point.at.size() != path.blocks[i].end.size() ||
          !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected u that never falls and finite axes in block {}", i));
      last = point.u;
    }
    if (dense[i].size() < 2 || dense[i].front().u != 0.0 || last != 1.0)
      throw std::invalid_argument(
          fmt::format("expected corrected points from u = 0 to u = 1 in block {}", i));
  }
}

/// Distance by which a point of the tool is off for given deviations of the axes: slides
/// geometrically, rotations by their levers.
class Measure {
 public:
  Measure(const std::vector<ControlledAxis>& axes, const AxisVector& lever)
      : slide_(AxisVector::Zero(Eigen::Index(axes.size()))), lever_(slide_) {
    for (std::size_t j = 0; j < axes.size(); ++j) {
      if (axes[j].motion == Motion::Linear) slide_[int(j)] = 1.0;
      if (axes[j].motion == Motion::Rotary && lever.size() > 0) lever_[int(j)] = lever[int(j)];
    }
  }
  double operator()(const AxisVector& off) const {
    return off.cwiseProduct(slide_).norm() + off.cwiseAbs().dot(lever_);
  }

 private:
  AxisVector slide_;
  AxisVector lever_;
};

/// Returns the last index of first .. last up to which `fits` holds, assuming that it holds at
/// `first` and is monotone. Strides double until one fails, then bisection: the number of tests
/// grows with the logarithm of the result.
template <class Fits>
std::size_t farthest(std::size_t first, std::size_t last, const Fits& fits) {
  std::size_t good = first, bad = last + 1;
  for (std::size_t stride = 1; good < last && bad > last; stride *= 2) {
    const std::size_t next = std::min(last, good + stride);
    if (fits(next))
      good = next;
    else
      bad = next;
  }
  while (bad <= last && bad - good > 1) {
    const std::size_t middle = good + (bad - good) / 2;
    (fits(middle) ? good : bad) = middle;
  }
  return good;
}

AxisVector on_line(const CorrectedPoint& a, const CorrectedPoint& b, double u) {
  return a.at + (u - a.u) / (b.u - a.u) * (b.at - a.at);
}

// Coordinates in the plane of an arc.
Vector2d in_plane(const Arc& arc, const AxisVector& q) { return {q[arc.first], q[arc.second]}; }

/// The circle through two corrected points whose centre is closest to the original centre displaced
/// like the points. Returns nothing if the arc would not survive the rounding of its words.
std::optional<Arc> corrected_arc(const Arc& arc, const CorrectedPoint& a, const CorrectedPoint& b,
                                 double word_mm) {
  const double sweep = arc.sweep * (b.u - a.u);
  const Vector2d start = in_plane(arc, a.at), end = in_plane(arc, b.at), chord = end - start;
  if (std::abs(sweep) > max_sweep || chord.norm() < min_chord_words * word_mm) return std::nullopt;
  // The centre follows the mean correction of the two ends, and is then projected onto the
  // perpendicular bisector of the chord, where every centre lies.
  const Vector2d moved = arc.centre + 0.5 * (start - position(arc, a.u) + end - position(arc, b.u));
  const Vector2d along = chord.normalized();
  Arc between = arc_through(
      {start, end, moved + along * along.dot(0.5 * (start + end) - moved), arc.sweep < 0.0});
  between.first = arc.first;
  between.second = arc.second;
  if (between.radius < min_radius_words * word_mm || std::abs(between.sweep) > pi)
    return std::nullopt;
  return between;
}

/// Thins the points of one block of lines, or of one arc.
class BlockThinner {
 public:
  /// `arc` is null unless the block is an arc.
  BlockThinner(const Points& dense, const Arc* arc, const Measure& measure,
               const ThinOptions& options)
      : dense_(dense), arc_(arc), measure_(measure), options_(options) {}

  Points run() {
    Points kept;
    std::size_t last = 0;  // last point before the next jump
    for (std::size_t from = 0;;) {
      // Points at the same time within the tolerance are one point: small jumps are smoothed.
      std::size_t next = from + 1;
      while (next < dense_.size() && is_near(from, next)) ++next;
      if (next == dense_.size()) return kept;
      if (dense_[next].u == dense_[from].u) {
        kept.push_back(line_to(next));
        from = next;
      } else {
        last = std::max(last, next);
        while (last + 1 < dense_.size() && !is_jump(last)) ++last;
        from = piece(from, {next, last}, kept);
      }
    }
  }

 private:
  /// Range of points that one part may reach.
  struct Range {
    std::size_t first = 0, last = 0;
  };

  /// Returns true for a point at the same time and, within the tolerance, the same position.
  bool is_near(std::size_t from, std::size_t k) const {
    return dense_[k].u == dense_[from].u &&
           measure_(dense_[k].at - dense_[from].at) <= options_.tolerance;
  }
  bool is_jump(std::size_t k) const { return dense_[k + 1].u == dense_[k].u && !is_near(k, k + 1); }
  CorrectedPoint line_to(std::size_t k) const { return {dense_[k].u, dense_[k].at, {}, {}}; }

  bool line_fits(std::size_t from, std::size_t to) const {
    for (std::size_t k = from + 1; k < to; ++k)
      if (measure_(dense_[k].at - on_line(dense_[from], dense_[to], dense_[k].u)) >
          options_.tolerance)
        return false;
    return true;
  }

  bool arc_fits(std::size_t from, std::size_t to) const {
    const CorrectedPoint &a = dense_[from], &b = dense_[to];
    const auto arc = corrected_arc(*arc_, a, b, options_.word_mm);
    if (!arc) return false;
    for (std::size_t k = from + 1; k < to; ++k) {
      AxisVector q = on_line(a, b, dense_[k].u);
      const Vector2d p = position(*arc, (dense_[k].u - a.u) / (b.u - a.u));
      q[arc->first] = p.x();
      q[arc->second] = p.y();
      if (measure_(dense_[k].at - q) > options_.tolerance) return false;
    }
    return true;
  }

  /// Returns the last point at which an arc may end, so that none exceeds `max_sweep` and all have
  /// about the same length.
  std::size_t last_of_arc(std::size_t from, std::size_t last) const {
    const double parts = std::ceil(std::abs(arc_->sweep) / max_sweep);
    std::size_t end = from + 1;
    while (end < last && dense_[end].u < dense_[from].u + 1.0 / parts - 1e-9) ++end;
    return end;
  }

  std::size_t piece(std::size_t from, Range range, Points& kept) const {
    const std::size_t line =
        farthest(range.first, range.last, [&](std::size_t to) { return line_fits(from, to); });
    const std::size_t end = arc_ == nullptr ? line : last_of_arc(from, range.last);
    // An arc that is too short to be one says nothing about longer ones, so the search starts where
    // the line ends.
    const std::size_t round =
        line < end ? farthest(line, end, [&](std::size_t to) { return arc_fits(from, to); }) : line;
    kept.push_back(line_to(round));
    if (round > line)
      kept.back().centre =
          corrected_arc(*arc_, dense_[from], dense_[round], options_.word_mm)->centre;
    return round;
  }

  const Points& dense_;
  const Arc* arc_;
  const Measure& measure_;
  const ThinOptions& options_;
};

/// A position in a path: block and fraction.
struct PathPosition {
  std::size_t block = 0;
  double u = 0.0;
};

/// Corrections of a path of cubics, as rows at their times.
struct Changes {
  std::vector<PathPosition> places;
  std::vector<PvtRow> rows;
};

/// The last of several points at one instant within a block counts; a block always starts where
/// the previous one ended.
Changes changes(const Path& path, std::span<const Points> dense) {
  Changes all;
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    const auto add = [&](double u, const AxisVector& at) {
      const double time_s =
          u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
      const AxisVector by = at - position(path, block, u);
      if (all.rows.empty() || time_s > all.rows.back().time_s) {
        all.places.push_back({i, u});
        all.rows.push_back({time_s, by, {}});
      } else if (all.places.back().block == i) {
        all.rows.back().position = by;
      }
    };
    if (dense[i].empty() && i == 0) add(0.0, block.start);
    for (const CorrectedPoint& point : dense[i]) add(point.u, point.at);
    if (dense[i].empty()) add(1.0, block.end);
  }
  const std::vector<AxisVector> velocities = rates(all.rows);
  for (std::size_t k = 0; k < velocities.size(); ++k) all.rows[k].velocity = velocities[k];
  return all;
}

/// The correction at an instant, on the cubic between two rows. The nominal part needs no such
/// term: a cubic that is split remains the same cubic.
AxisVector on_cubic(const PvtRow& a, const PvtRow& b, double time_s) {
  const double duration = b.time_s - a.time_s, u = (time_s - a.time_s) / duration;
  const AxisVector way = b.position - a.position;
  return a.position + u * way +
         u * (1 - u) *
             ((1 - u) * (duration * a.velocity - way) - u * (duration * b.velocity - way));
}

CorrectedPath thinned_cubics(const Path& path, std::span<const Points> dense,
                             const Measure& measure, double tolerance) {
  CorrectedPath kept(dense.size());
  const auto [places, rows] = changes(path, dense);
  const auto keep = [&, &places = places, &rows = rows](std::size_t k) {
    const auto [block, u] = places[k];
    kept[block].push_back(
        {u, position(path, path.blocks[block], u) + rows[k].position, {}, rows[k].velocity});
  };
  const auto fits = [&, &rows = rows](std::size_t from, std::size_t to) {
    for (std::size_t k = from + 1; k < to; ++k)
      if (measure(rows[k].position - on_cubic(rows[from], rows[to], rows[k].time_s)) > tolerance)
        return false;
    return true;
  };
  keep(0);
  std::size_t end = 0;
  for (std::size_t from = 0; from + 1 < rows.size();) {
    if (end <= from) end = from + 1;
    // A part may not extend beyond the end of its block, since ends of blocks are kept.
    while (places[end].u < 1.0) ++end;
    from = farthest(from + 1, end, [&](std::size_t to) { return fits(from, to); });
    keep(from);
  }
  return kept;
}

}  // namespace

CorrectedPath thinned(const Path& path, std::span<const Points> dense, const NcOptions& control,
                      const ThinOptions& options) {
  check_dense(path, dense);
  if (!(options.tolerance >= 0.0) || !(options.word_mm >= 0.0))
    throw std::invalid_argument("expected a tolerance and words of at least zero");
  const std::array<Measure, 2> measures = {Measure(control.axes, options.lever[0]),
                                           Measure(control.axes, options.lever[1])};
  const auto is_cubic = [](const Block& block) {
    return block.interpolation == Interpolation::Cubic;
  };
  // Cubics join smoothly over the ends of blocks, so all are thinned together, with rates; other
  // blocks are thinned one by one.
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return thinned_cubics(path, dense, measures[0], options.tolerance);
  CorrectedPath kept(dense.size());
  std::optional<AxisVector> stands;  // end of the previous block, if in the same coordinates
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    if (i == 0) stands = block.start;
    if (i > 0 && path.blocks[i - 1].coordinates != block.coordinates) stands.reset();
    if (dense[i].empty()) {
      if (block.interpolation != Interpolation::Dwell) stands = block.end;
      continue;
    }
    if (block.interpolation == Interpolation::Rapid) {
      kept[i] = {dense[i].back()};
    } else {
      Points points = dense[i];
      if (stands) points.insert(points.begin(), {0.0, *stands, {}, {}});
      // Arcs in rotated planes are thinned as lines: NC text has no plane for them.
      const bool is_arc =
          block.interpolation == Interpolation::Arc && path.arcs[block.shape].plane_rotation < 0;
      kept[i] = BlockThinner(points, is_arc ? &path.arcs[block.shape] : nullptr,
                             measures[std::size_t(block.coordinates)], options)
                    .run();
      // After a change between axes and tip the position is stated again.
      if (!stands && kept[i].front().u > 0.0) kept[i].insert(kept[i].begin(), dense[i].front());
    }
    stands = dense[i].back().at;
  }
  return kept;
}

namespace {

bool is_cubic(const Block& block) { return block.interpolation == Interpolation::Cubic; }

void check_corrected(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected) {
  if (corrected.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    double last = 0.0;
    for (const CorrectedPoint& point : corrected[i]) {
      const bool before = is_cubic(path.blocks[i]) ? point.u <= last : point.u < last;
      const bool start = point.u == 0.0 && i == 0 && &point == &corrected[i].front();
      if ((before && !start) || !(point.u >= 0.0 && point.u <= 1.0) ||
          point.at.size() != path.blocks[i].end.size() || !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected increasing u in [0, 1] and finite axes in block {}", i));
      if (point.centre && !point.centre->allFinite())
        throw std::invalid_argument(fmt::format("expected finite centres in block {}", i));
      if (point.centre && path.blocks[i].interpolation != Interpolation::Arc)
        throw std::invalid_argument(fmt::format("expected arcs in an arc, not in block {}", i));
      last = point.u;
    }
    if (!corrected[i].empty() && last != 1.0)
      throw std::invalid_argument(
          fmt::format("expected a corrected point at u = 1 in block {}", i));
  }
}

RewrittenProgram rewritten_pvt(const Path& path,
                               std::span<const std::vector<CorrectedPoint>> corrected,
                               const NcOptions& control) {
  RewrittenProgram program;
  program.of_line.emplace_back();  // the head
  std::vector<PvtRow> nominal, correction;
  const auto add = [&](int index, double u, const CorrectedPoint* point) {
    const Block& block = path.blocks[std::size_t(index)];
    const double time_s =
        u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
    nominal.push_back({time_s, position(path, block, u), velocity(path, block, u)});
    const AxisVector& here = nominal.back().position;
    correction.push_back({time_s, point ? AxisVector(point->at - here) : AxisVector(0 * here),
                          point ? point->rate : AxisVector()});
    const Stretch& last = program.of_line.back();
    program.of_line.push_back({index, last.block == index ? last.to : 0.0, u});
  };
  for (int i = 0; i < int(path.blocks.size()); ++i) {
    const std::vector<CorrectedPoint>& points = corrected[std::size_t(i)];
    if (i == 0 && (points.empty() || points.front().u > 0.0)) add(i, 0.0, nullptr);
    for (const CorrectedPoint& point : points) add(i, point.u, &point);
    if (points.empty()) add(i, 1.0, nullptr);
  }
  // Rates not given with the correction are those of the parabola through its neighbours.
  const std::vector<AxisVector> extra = rates(correction);
  for (std::size_t k = 0; k < nominal.size(); ++k) {
    const AxisVector& rate = correction[k].velocity.size() > 0 ? correction[k].velocity : extra[k];
    for (Eigen::Index j = 0; j < nominal[k].position.size(); ++j) {
      // Adding a correction of zero would turn -0 into +0.
      if (correction[k].position[j] != 0.0) nominal[k].position[j] += correction[k].position[j];
      if (rate[j] != 0.0) nominal[k].velocity[j] += rate[j];
    }
  }
  std::vector<int> columns(control.axes.size());
  std::iota(columns.begin(), columns.end(), 0);
  program.text = write_pvt(nominal, control.axes, columns);
  return program;
}

// s, time given to a jump, such as the compensation of play
constexpr double jump_s = 1e-3;
constexpr double min_feed = 1e-9;  // per minute, smallest feed that a control accepts
// mm or deg, assumed length of a move from an unknown position
constexpr double unknown_way = 0.01;
constexpr double same_word = 1e-6;  // of a step; tolerance for equal words after rounding

/// Writes a path as NC text, block by block.
class NcRewriter {
 public:
  NcRewriter(const Path& path, const NcOptions& control, const RewriteOptions& options);
  void block(int index, const std::vector<CorrectedPoint>& points);
  RewrittenProgram program();

 private:
  /// A point as rounded words, and its fraction of the block.
  struct Point {
    double u = 1.0;
    AxisVector words;  ///< mm and rad, without offsets
    std::optional<Vector2d> centre;
  };

  void say(std::string line);
  void write_auxiliary_words(std::size_t before);
  void dialect(const Block& block);
  void coordinates(const Block& block);
  void spindle(const Block& block);
  void wait(double seconds, const Stretch& stretch);
  void pieces(int index, const std::vector<CorrectedPoint>& points);
  void move(const Block& block, const Point& to, double seconds, const Stretch& stretch);
  std::optional<Arc> round(const Block& block, const Point& to) const;
  std::vector<CorrectedPoint> chords(const Block& block) const;
  std::vector<CorrectedPoint> half_turns(const Block& block) const;
  void plane(std::string_view letters);
  double feed(const FeedLength& way, double seconds) const;
  double step(int joint) const;
  double offset(int joint) const;
  bool is_at_words(const AxisVector& words) const;
  AxisVector words(const AxisVector& at) const;
  AxisVector in_units(AxisVector words) const;

  const Path& path_;
  const NcOptions& control_;
  const RewriteOptions& options_;
  RewrittenProgram program_;
  std::vector<NcItem> items_;
  const std::optional<ProgramZero> zero_;
  std::optional<Coordinates> mode_;
  std::optional<AxisVector> stands_;  ///< words of the current position, if known
  std::optional<bool> inch_, inverse_time_;
  std::string plane_ = "IJ";
  std::size_t auxiliary_words_written_ = 0;  ///< number of words written so far
  double rpm_ = 0.0;
  const int spindle_;
};

NcRewriter::NcRewriter(const Path& path, const NcOptions& control, const RewriteOptions& options)
    : path_(path),
      control_(control),
      options_(options),
      zero_(program_zero(control)),
      spindle_(find_spindle(control.axes)) {
  say("(corrected program)");
  say("G17 G90 G91.1 G54");
  if (path.blocks.empty()) say("G49");
}

void NcRewriter::say(std::string line) {
  items_.push_back(std::move(line));
  program_.of_line.emplace_back();
}

void NcRewriter::write_auxiliary_words(std::size_t before) {
  while (auxiliary_words_written_ < path_.auxiliary_words.size() &&
         path_.auxiliary_words[auxiliary_words_written_].before <= before)
    say(path_.auxiliary_words[auxiliary_words_written_++].text);
}

void NcRewriter::dialect(const Block& block) {
  if (inch_ != block.inch) say(block.inch ? "G20" : "G21");
  if (inverse_time_ != block.inverse_time) say(block.inverse_time ? "G93" : "G94");
  inch_ = block.inch;
  inverse_time_ = block.inverse_time;
}

void NcRewriter::coordinates(const Block& block) {
  if (mode_ == block.coordinates) return;
  const bool first = !mode_;
  mode_ = block.coordinates;
  // At the start the position is known. After a change of coordinates it depends on corrections
  // that are not known here.
  stands_ = first ? std::optional(words(block.start)) : std::nullopt;
  if (mode_ == Coordinates::Axis) return say("G49");
  if (control_.tool_length.empty())
    throw std::invalid_argument("expected a tool length for G43.4 H");
  const bool one = control_.control_of_h.size() == 1;  // of a tool table with many tools
  say(fmt::format("G43.4 H{}", one ? control_.control_of_h.begin()->first
                                   : control_.tool_length.begin()->first));
}

void NcRewriter::spindle(const Block& block) {
  if (spindle_ < 0 || !(block.end_s > block.start_s)) return;
  const double rate = (block.end[spindle_] - block.start[spindle_]) / (block.end_s - block.start_s);
  // The angle is a sum over many turns; the rounding that remains in its rate is no change of
  // speed. 1e-5 rpm is far below what a spindle holds.
  const double rpm = std::round(rate / units::rpm * 1e6) / 1e6;
  if (std::abs(rpm - rpm_) <= 1e-5) return;
  rpm_ = rpm;
  say(rpm == 0.0 ? "M5" : fmt::format("S{} M{}", nc_number(std::abs(rpm), 6), rpm > 0 ? 3 : 4));
}

void NcRewriter::wait(double seconds, const Stretch& stretch) {
  if (!(seconds > 0.0)) return;
  say("G4 P" + nc_number(seconds));
  program_.of_line.back() = stretch;
}

/// Resolution of a word: mm (also under inches) and rad.
double NcRewriter::step(int joint) const {
  if (control_.axes[std::size_t(joint)].motion != Motion::Linear) return options_.word_rad;
  if (inch_ != true) return options_.word_mm;
  // 1e-9 keeps a resolution that is an exact power of ten inches from falling to the next lower
  // one.
  return std::pow(10.0, std::floor(std::log10(options_.word_mm / units::inch) + 1e-9)) *
         units::inch;
}

/// Returns what G54 and the program zero add to a word in the coordinates in force.
double NcRewriter::offset(int joint) const {
  const AxisVector& g54 = control_.work_offset[0];
  const char name = control_.axes[std::size_t(joint)].name;
  const double more =
      name >= 'X' && name <= 'Z' ? offset_correction(zero_, *mode_)[name - 'X'] : 0.0;
  return (g54.size() > 0 ? g54[joint] : 0.0) + more;
}

// Rounds in the programmed unit (degrees, not radians), in which the words are written.
AxisVector NcRewriter::words(const AxisVector& at) const {
  AxisVector words = at;
  for (int j = 0; j < int(words.size()); ++j) {
    const double unit = control_.axes[std::size_t(j)].motion == Motion::Linear ? 1.0 : units::deg;
    const double word = step(j) / unit;
    const double value = (words[j] - offset(j)) / unit;
    words[j] = std::round(value / word) * word * unit;
  }
  return words;
}

AxisVector NcRewriter::in_units(AxisVector words) const {
  if (inch_ == true)
    for (int j = 0; j < int(words.size()); ++j)
      if (control_.axes[std::size_t(j)].motion == Motion::Linear) words[j] /= units::inch;
  return words;
}

bool NcRewriter::is_at_words(const AxisVector& words) const {
  if (!stands_) return false;
  for (int j = 0; j < int(words.size()); ++j) {
    if (control_.axes[std::size_t(j)].motion == Motion::Spindle || j == spindle_) continue;
    if (std::abs(words[j] - (*stands_)[j]) > same_word * step(j)) return false;
  }
  return true;
}

double NcRewriter::feed(const FeedLength& way, double seconds) const {
  if (inverse_time_ == true) return std::max(min_feed, 60.0 / seconds);
  const double unit = way.linear && inch_ == true ? units::inch : 1.0;
  return std::max(min_feed, way.length / unit / seconds * 60.0);
}

void NcRewriter::plane(std::string_view letters) {
  if (plane_ == letters) return;
  plane_ = letters;
  say(letters == "IJ" ? "G17" : letters == "KI" ? "G18" : "G19");
}

/// Returns the arc to a point as its rounded words define it. Returns nothing if they leave only a
/// line.
std::optional<Arc> NcRewriter::round(const Block& block, const Point& to) const {
  if (!to.centre || !stands_) return std::nullopt;
  const Arc& arc = path_.arcs[block.shape];
  const double word = step(arc.first);
  ArcGeometry words;
  words.clockwise = arc.sweep < 0.0;
  for (int k = 0; k < 2; ++k) {
    const int j = k == 0 ? arc.first : arc.second;
    words.start[k] = (*stands_)[j];
    words.end[k] = to.words[j];
    const double centre = (*to.centre)[k] - offset(j);
    // I J K are written relative to the start, so the offset is what is rounded.
    words.centre[k] = words.start[k] + std::round((centre - words.start[k]) / word) * word;
  }
  // Steps of a word; a smaller arc may have lost its sense of rotation by rounding.
  constexpr double least = 5.0;
  if ((words.end - words.start).norm() < least * word ||
      (words.centre - words.start).norm() < least * word)
    return std::nullopt;
  Arc round = arc_through(words);
  round.first = arc.first;
  round.second = arc.second;
  return round;
}

void NcRewriter::move(const Block& block, const Point& to, double seconds, const Stretch& stretch) {
  NcMove move{block.interpolation == Interpolation::Rapid, in_units(to.words), 0.0, {}};
  const std::optional<Arc> round = this->round(block, to);
  if (round) {
    const char first = control_.axes[std::size_t(round->first)].name;
    const std::string letters = first == 'X' ? "IJ" : first == 'Z' ? "KI" : "JK";
    plane(letters);
    const Vector2d start((*stands_)[round->first], (*stands_)[round->second]);
    move.round = {round->sweep < 0.0, letters,
                  (round->centre - start) / (inch_ == true ? units::inch : 1.0)};
  }
  if (!move.rapid) {
    FeedLength way = feed_length(control_.axes, stands_ ? *stands_ : words(block.start), to.words,
                                 round ? &*round : nullptr);
    // From an unknown position the length may be computed as nearly zero; the feed must not become
    // a crawl.
    if (!stands_) way.length = std::max(way.length, unknown_way);
    move.feed = feed(way, seconds);
  }
  items_.push_back(std::move(move));
  program_.of_line.push_back(stretch);
  stands_ = to.words;
}

/// Writes the parts of a block. A part that no longer moves by one step gives its time to the next;
/// the last one becomes a dwell.
void NcRewriter::pieces(int index, const std::vector<CorrectedPoint>& points) {
  const Block& block = path_.blocks[std::size_t(index)];
  const bool rapid = block.interpolation == Interpolation::Rapid;
  const double duration = block.end_s - block.start_s;
  double u = 0.0, taken = 0.0;  // s, time taken by jumps
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Point to{points[k].u, words(points[k].at), points[k].centre};
    const bool still = is_at_words(to.words);
    const Stretch stretch{index, u, to.u};
    if (to.u == u && !rapid) {
      if (still) continue;
      // Half of the time to the next point at most, so that the motion that follows keeps some.
      const double rest = k + 1 < points.size() ? (points[k + 1].u - u) * duration : 2 * jump_s;
      const double seconds = std::min(jump_s, 0.5 * rest);
      taken += seconds;
      move(block, to, seconds, stretch);
      continue;
    }
    if (still && k + 1 < points.size() && points[k + 1].u > to.u) continue;
    const double seconds = (to.u - u) * duration - taken;
    if (!still)
      move(block, to, seconds, stretch);
    else if (!rapid)
      wait(seconds, stretch);
    u = to.u;
    taken = 0.0;
  }
}

/// Splits an arc in a plane without a G code into chords that deviate by at most half a step of a
/// word.
std::vector<CorrectedPoint> NcRewriter::chords(const Block& block) const {
  const Arc& arc = path_.arcs[block.shape];
  const double radius = arc.radius + std::max(0.0, arc.growth);
  // A chord of this angle has a sagitta of half a step.
  const double step = 2 * std::acos(1.0 - std::min(1.0, 0.5 * options_.word_mm / radius));
  // The limit of 1e6 chords bounds memory.
  const int n = std::max(2, int(std::ceil(std::min(1e6, std::abs(arc.sweep) / step))));
  std::vector<CorrectedPoint> points;
  for (int k = 1; k <= n; ++k)
    points.push_back({double(k) / n, position(path_, block, double(k) / n), {}, {}});
  return points;
}

/// Splits an arc that ends near its start, or exceeds one turn, into parts of at most half a turn:
/// end and centre alone define less than one whole turn.
std::vector<CorrectedPoint> NcRewriter::half_turns(const Block& block) const {
  const Arc& arc = path_.arcs[block.shape];
  const int n = std::max(2, int(std::ceil(std::abs(arc.sweep) / pi - 1e-9)));
  std::vector<CorrectedPoint> points;
  for (int k = 1; k <= n; ++k)
    points.push_back({double(k) / n,
                      k == n ? block.end : position(path_, block, double(k) / n),
                      arc.centre,
                      {}});
  return points;
}

void NcRewriter::block(int index, const std::vector<CorrectedPoint>& points) {
  const Block& block = path_.blocks[std::size_t(index)];
  if (is_cubic(block)) throw std::invalid_argument("expected a path of cubics only, or of none");
  write_auxiliary_words(std::size_t(index));
  dialect(block);
  coordinates(block);
  spindle(block);
  if (block.interpolation == Interpolation::Dwell)
    return wait(block.end_s - block.start_s, {index, 0.0, 1.0});
  if (!points.empty()) return pieces(index, points);
  if (block.interpolation == Interpolation::Arc && path_.arcs[block.shape].plane_rotation >= 0)
    return pieces(index, chords(block));
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block.shape];
    const Vector2d chord(block.end[arc.first] - block.start[arc.first],
                         block.end[arc.second] - block.start[arc.second]);
    // Fraction of the radius: across so short a chord the direction of the end has two digits
    // fewer.
    constexpr double near = 0.01;
    if (std::abs(arc.sweep) > pi && chord.norm() < near * arc.radius)
      return pieces(index, half_turns(block));
    if (std::abs(arc.sweep) > 2 * pi) return pieces(index, half_turns(block));
  }
  CorrectedPoint end{1.0, block.end, {}, {}};
  if (block.interpolation == Interpolation::Arc) end.centre = path_.arcs[block.shape].centre;
  // Moves onto whole steps first. Otherwise the displacement by rounding would count as the length
  // of a block that only rotates.
  if (!stands_ && block.interpolation != Interpolation::Rapid)
    return pieces(index, {{0.0, block.start, {}, {}}, end});
  pieces(index, {end});
}

RewrittenProgram NcRewriter::program() {
  write_auxiliary_words(path_.blocks.size());
  if (rpm_ != 0.0) say("M5");
  say("M2");
  // More digits than the resolution has, so that the text adds no rounding of its own.
  program_.text =
      write_nc(items_, control_.axes,
               {.format = {11, 9},
                .inverse_time = std::any_of(path_.blocks.begin(), path_.blocks.end(),
                                            [](auto& block) { return block.inverse_time; }),
                .feed_digits = 9});
  return std::move(program_);
}

}  // namespace

RewrittenProgram rewritten(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected,
                           const NcOptions& control, const RewriteOptions& options) {
  check_corrected(path, corrected);
  // Eleven decimals are written, so a finer resolution could not be represented.
  if (!(options.word_mm >= 1e-9) || !(options.word_rad >= 1e-9 * units::deg))
    throw std::invalid_argument("expected steps of words of at least 1e-9");
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return rewritten_pvt(path, corrected, control);
  NcRewriter writer(path, control, options);
  for (std::size_t i = 0; i < path.blocks.size(); ++i) writer.block(int(i), corrected[i]);
  return writer.program();
}

}  // namespace abbe::sim::program
