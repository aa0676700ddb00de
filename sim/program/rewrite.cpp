#include "sim/program/rewrite.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/program/program_writers.h"

namespace abbe::sim::program {

namespace {

using Eigen::Vector2d;
using kinematics::AxisVector;
using kinematics::Motion;
using Points = std::vector<CorrectedPoint>;

// Beyond 0.9 half turns the middle of an arc depends strongly on the rounding of its centre, and a
// full circle could not be distinguished from no motion.
constexpr double max_arc_sweep = 0.9 * pi;
// Steps of a word; rounding would distort a smaller radius by more than 1 %.
constexpr double min_radius_steps = 50.0;
// Steps of a word; rounding would dominate the direction of a shorter chord.
constexpr double min_chord_steps = 20.0;

bool is_cubic(const Block& block) { return block.interpolation == Interpolation::Cubic; }

/// Throws std::invalid_argument unless each list is empty or goes from u = 0 to u = 1 without
/// falling.
void check_dense(const Path& path, std::span<const Points> dense) {
  if (dense.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < dense.size(); ++i) {
    if (dense[i].empty()) continue;
    double previous_u = 0.0;
    for (const CorrectedPoint& point : dense[i]) {
      if (!(point.u >= previous_u && point.u <= 1.0) ||
          point.at.size() != path.blocks[i].end.size() || !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected non-decreasing u and finite axes in block {}", i));
      previous_u = point.u;
    }
    if (dense[i].size() < 2 || dense[i].front().u != 0.0 || previous_u != 1.0)
      throw std::invalid_argument(
          fmt::format("expected corrected points from u = 0 to u = 1 in block {}", i));
  }
}

/// Returns the deviation of a point of the tool, mm, for deviations of the axes: the Euclidean norm
/// of the slides plus the sum of rotations times levers.
class DeviationNorm {
 public:
  DeviationNorm(const std::vector<ControlledAxis>& axes, const AxisVector& lever)
      : slide_(AxisVector::Zero(Eigen::Index(axes.size()))), lever_(slide_) {
    for (std::size_t j = 0; j < axes.size(); ++j) {
      if (axes[j].motion == Motion::Linear) slide_[int(j)] = 1.0;
      if (axes[j].motion == Motion::Rotary && lever.size() > 0) lever_[int(j)] = lever[int(j)];
    }
  }
  double operator()(const AxisVector& deviation) const {
    return deviation.cwiseProduct(slide_).norm() + deviation.cwiseAbs().dot(lever_);
  }

 private:
  AxisVector slide_;
  AxisVector lever_;
};

/// Returns the last index of first .. last for which `fits` holds. It must hold at `first` and be
/// monotone. Strides double until one fails, then bisection follows, so the number of tests grows
/// with the logarithm of the result.
template <class Fits>
std::size_t find_farthest(std::size_t first, std::size_t last, const Fits& fits) {
  std::size_t accepted = first, rejected = last + 1;
  for (std::size_t stride = 1; accepted < last && rejected > last; stride *= 2) {
    const std::size_t candidate = std::min(last, accepted + stride);
    if (fits(candidate))
      accepted = candidate;
    else
      rejected = candidate;
  }
  while (rejected <= last && rejected - accepted > 1) {
    const std::size_t middle = accepted + (rejected - accepted) / 2;
    (fits(middle) ? accepted : rejected) = middle;
  }
  return accepted;
}

AxisVector point_on_line(const CorrectedPoint& a, const CorrectedPoint& b, double u) {
  return a.at + (u - a.u) / (b.u - a.u) * (b.at - a.at);
}

Vector2d in_plane(const Arc& arc, const AxisVector& q) { return {q[arc.first], q[arc.second]}; }

/// Returns the arc through two corrected points whose centre is closest to the original centre,
/// displaced as the points are. Returns nothing if the arc would not survive the rounding of its
/// words.
std::optional<Arc> corrected_arc(const Arc& arc, const CorrectedPoint& a, const CorrectedPoint& b,
                                 double word_mm) {
  const double sweep = arc.sweep * (b.u - a.u);
  const Vector2d start = in_plane(arc, a.at), end = in_plane(arc, b.at), chord = end - start;
  if (std::abs(sweep) > max_arc_sweep || chord.norm() < min_chord_steps * word_mm)
    return std::nullopt;
  // The centre follows the mean correction of the two ends, and is then projected onto the
  // perpendicular bisector of the chord, where every centre lies.
  const Vector2d moved_centre =
      arc.centre + 0.5 * (start - position(arc, a.u) + end - position(arc, b.u));
  const Vector2d along = chord.normalized();
  Arc new_arc =
      arc_through({start, end, moved_centre + along * along.dot(0.5 * (start + end) - moved_centre),
                   arc.sweep < 0.0});
  new_arc.first = arc.first;
  new_arc.second = arc.second;
  if (new_arc.radius < min_radius_steps * word_mm || std::abs(new_arc.sweep) > pi)
    return std::nullopt;
  return new_arc;
}

/// Thins the points of one block, which consists of lines or is an arc.
class BlockThinner {
 public:
  /// `arc` is null unless the block is an arc.
  BlockThinner(const Points& dense, const Arc* arc, const DeviationNorm& norm,
               const ThinOptions& options)
      : dense_(dense), arc_(arc), norm_(norm), options_(options) {}

  Points run() {
    Points kept_points;
    std::size_t last = 0;  // last point before the next jump
    for (std::size_t from = 0;;) {
      // Small jumps are smoothed: points at the same time within the tolerance count as one point.
      std::size_t next = from + 1;
      while (next < dense_.size() && is_near(from, next)) ++next;
      if (next == dense_.size()) return kept_points;
      if (dense_[next].u == dense_[from].u) {
        kept_points.push_back(line_to(next));
        from = next;
      } else {
        last = std::max(last, next);
        while (last + 1 < dense_.size() && !is_jump(last)) ++last;
        from = add_segment(from, {next, last}, kept_points);
      }
    }
  }

 private:
  /// The points at which a line or arc may end.
  struct Range {
    std::size_t first = 0, last = 0;
  };

  /// Returns true for a point at the same time and, within the tolerance, the same position.
  bool is_near(std::size_t from, std::size_t k) const {
    return dense_[k].u == dense_[from].u &&
           norm_(dense_[k].at - dense_[from].at) <= options_.tolerance;
  }
  bool is_jump(std::size_t k) const { return dense_[k + 1].u == dense_[k].u && !is_near(k, k + 1); }
  CorrectedPoint line_to(std::size_t k) const { return {dense_[k].u, dense_[k].at, {}, {}}; }

  bool line_fits(std::size_t from, std::size_t to) const {
    for (std::size_t k = from + 1; k < to; ++k)
      if (norm_(dense_[k].at - point_on_line(dense_[from], dense_[to], dense_[k].u)) >
          options_.tolerance)
        return false;
    return true;
  }

  bool arc_fits(std::size_t from, std::size_t to) const {
    const CorrectedPoint &a = dense_[from], &b = dense_[to];
    const auto arc = corrected_arc(*arc_, a, b, options_.word_mm);
    if (!arc) return false;
    for (std::size_t k = from + 1; k < to; ++k) {
      AxisVector q = point_on_line(a, b, dense_[k].u);
      const Vector2d p = position(*arc, (dense_[k].u - a.u) / (b.u - a.u));
      q[arc->first] = p.x();
      q[arc->second] = p.y();
      if (norm_(dense_[k].at - q) > options_.tolerance) return false;
    }
    return true;
  }

  /// Returns the last point at which an arc may end, so that none exceeds `max_arc_sweep` and all
  /// have about the same length.
  std::size_t last_of_arc(std::size_t from, std::size_t last) const {
    const double parts = std::ceil(std::abs(arc_->sweep) / max_arc_sweep);
    std::size_t end = from + 1;
    while (end < last && dense_[end].u < dense_[from].u + 1.0 / parts - 1e-9) ++end;
    return end;
  }

  std::size_t add_segment(std::size_t from, Range range, Points& kept_points) const {
    const std::size_t line_end =
        find_farthest(range.first, range.last, [&](std::size_t to) { return line_fits(from, to); });
    const std::size_t end = arc_ == nullptr ? line_end : last_of_arc(from, range.last);
    // A longer arc may fit where a very short one does not, so the search starts at the end of the
    // line.
    const std::size_t arc_end =
        line_end < end
            ? find_farthest(line_end, end, [&](std::size_t to) { return arc_fits(from, to); })
            : line_end;
    kept_points.push_back(line_to(arc_end));
    if (arc_end > line_end)
      kept_points.back().centre =
          corrected_arc(*arc_, dense_[from], dense_[arc_end], options_.word_mm)->centre;
    return arc_end;
  }

  const Points& dense_;
  const Arc* arc_;
  const DeviationNorm& norm_;
  const ThinOptions& options_;
};

/// A block and a fraction of its time.
struct PathPosition {
  std::size_t block = 0;
  double u = 0.0;
};

/// Corrections of a path of cubics as rows of a PVT file, and the position of each in the path.
struct CorrectionRows {
  std::vector<PathPosition> positions;
  std::vector<PvtRow> rows;
};

/// The last of several points at one instant within a block counts. A block always starts at
/// the end of the previous one.
CorrectionRows correction_rows(const Path& path, std::span<const Points> dense) {
  CorrectionRows result;
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    const auto add = [&](double u, const AxisVector& corrected) {
      const double time_s =
          u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
      const AxisVector correction = corrected - position(path, block, u);
      if (result.rows.empty() || time_s > result.rows.back().time_s) {
        result.positions.push_back({i, u});
        result.rows.push_back({time_s, correction, {}});
      } else if (result.positions.back().block == i) {
        result.rows.back().position = correction;
      }
    };
    if (dense[i].empty() && i == 0) add(0.0, block.start);
    for (const CorrectedPoint& point : dense[i]) add(point.u, point.at);
    if (dense[i].empty()) add(1.0, block.end);
  }
  const std::vector<AxisVector> velocities = parabola_rates(result.rows);
  for (std::size_t k = 0; k < velocities.size(); ++k) result.rows[k].velocity = velocities[k];
  return result;
}

CorrectedPath thinned_cubics(const Path& path, std::span<const Points> dense,
                             const DeviationNorm& norm, double tolerance) {
  CorrectedPath kept_points(dense.size());
  const auto [positions, rows] = correction_rows(path, dense);
  const auto keep_row = [&, &positions = positions, &rows = rows](std::size_t k) {
    const auto [block, u] = positions[k];
    kept_points[block].push_back(
        {u, position(path, path.blocks[block], u) + rows[k].position, {}, rows[k].velocity});
  };
  // Only corrections are interpolated, because a nominal cubic that is split remains the same
  // cubic.
  const auto fits = [&, &rows = rows](std::size_t from, std::size_t to) {
    const double duration = rows[to].time_s - rows[from].time_s;
    for (std::size_t k = from + 1; k < to; ++k) {
      const AxisVector correction =
          hermite_position(rows[from], rows[to], (rows[k].time_s - rows[from].time_s) / duration);
      if (norm(rows[k].position - correction) > tolerance) return false;
    }
    return true;
  };
  keep_row(0);
  std::size_t end = 0;
  for (std::size_t from = 0; from + 1 < rows.size();) {
    if (end <= from) end = from + 1;
    // Ends of blocks are kept, so a part must not extend beyond its block.
    while (positions[end].u < 1.0) ++end;
    from = find_farthest(from + 1, end, [&](std::size_t to) { return fits(from, to); });
    keep_row(from);
  }
  return kept_points;
}

}  // namespace

CorrectedPath thin_out(const Path& path, std::span<const Points> dense, const NcOptions& control,
                       const ThinOptions& options) {
  check_dense(path, dense);
  if (!(options.tolerance >= 0.0) || !(options.word_mm >= 0.0))
    throw std::invalid_argument(
        "expected a non-negative tolerance and a non-negative word resolution");
  const std::array<DeviationNorm, 2> norms = {DeviationNorm(control.axes, options.lever[0]),
                                              DeviationNorm(control.axes, options.lever[1])};
  // Cubics join smoothly over the ends of blocks, so all are thinned together, with their
  // velocities; other blocks are thinned one by one.
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return thinned_cubics(path, dense, norms[0], options.tolerance);
  CorrectedPath kept_points(dense.size());
  std::optional<AxisVector> current;  // end of the previous block, if in the same coordinates
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    if (i == 0) current = block.start;
    if (i > 0 && path.blocks[i - 1].coordinates != block.coordinates) current.reset();
    if (dense[i].empty()) {
      if (block.interpolation != Interpolation::Dwell) current = block.end;
      continue;
    }
    if (block.interpolation == Interpolation::Rapid) {
      kept_points[i] = {dense[i].back()};
    } else {
      Points points = dense[i];
      if (current) points.insert(points.begin(), {0.0, *current, {}, {}});
      // NC text has no code for a rotated plane, so arcs in it are thinned as lines.
      const bool is_arc =
          block.interpolation == Interpolation::Arc && path.arcs[block.shape].plane_rotation < 0;
      kept_points[i] = BlockThinner(points, is_arc ? &path.arcs[block.shape] : nullptr,
                                    norms[std::size_t(block.coordinates)], options)
                           .run();
      // After a change between axes and tip the position is stated again.
      if (!current && kept_points[i].front().u > 0.0)
        kept_points[i].insert(kept_points[i].begin(), dense[i].front());
    }
    current = dense[i].back().at;
  }
  return kept_points;
}

namespace {

/// Throws std::invalid_argument unless each list is empty or increases to u = 1 and fits its block.
void check_corrected(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected) {
  if (corrected.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    double previous_u = 0.0;
    for (const CorrectedPoint& point : corrected[i]) {
      const bool before = is_cubic(path.blocks[i]) ? point.u <= previous_u : point.u < previous_u;
      const bool start = point.u == 0.0 && i == 0 && &point == &corrected[i].front();
      if ((before && !start) || !(point.u >= 0.0 && point.u <= 1.0) ||
          point.at.size() != path.blocks[i].end.size() || !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected increasing u in [0, 1] and finite axes in block {}", i));
      if (point.centre && !point.centre->allFinite())
        throw std::invalid_argument(fmt::format("expected finite centres in block {}", i));
      if (point.centre && path.blocks[i].interpolation != Interpolation::Arc)
        throw std::invalid_argument(
            fmt::format("expected arc points only in an arc, not in block {}", i));
      previous_u = point.u;
    }
    if (!corrected[i].empty() && previous_u != 1.0)
      throw std::invalid_argument(
          fmt::format("expected a corrected point at u = 1 in block {}", i));
  }
}

/// Writes a path of cubics as PVT, with the corrections added to its rows.
RewrittenProgram rewritten_pvt(const Path& path,
                               std::span<const std::vector<CorrectedPoint>> corrected,
                               const NcOptions& control) {
  RewrittenProgram program;
  program.line_origins.emplace_back();  // the head
  std::vector<PvtRow> nominal, correction;
  const auto add = [&](int index, double u, const CorrectedPoint* point) {
    const Block& block = path.blocks[std::size_t(index)];
    const double time_s =
        u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
    nominal.push_back({time_s, position(path, block, u), velocity(path, block, u)});
    const AxisVector& nominal_position = nominal.back().position;
    correction.push_back(
        {time_s,
         point ? AxisVector(point->at - nominal_position) : AxisVector(0 * nominal_position),
         point ? point->rate : AxisVector()});
    const LineOrigin& previous = program.line_origins.back();
    program.line_origins.push_back({index, previous.block == index ? previous.to : 0.0, u});
  };
  for (int i = 0; i < int(path.blocks.size()); ++i) {
    const std::vector<CorrectedPoint>& points = corrected[std::size_t(i)];
    if (i == 0 && (points.empty() || points.front().u > 0.0)) add(i, 0.0, nullptr);
    for (const CorrectedPoint& point : points) add(i, point.u, &point);
    if (points.empty()) add(i, 1.0, nullptr);
  }
  // A correction without a rate gets that of the parabola through it and its neighbours.
  const std::vector<AxisVector> derived_rates = parabola_rates(correction);
  for (std::size_t k = 0; k < nominal.size(); ++k) {
    const AxisVector& rate =
        correction[k].velocity.size() > 0 ? correction[k].velocity : derived_rates[k];
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

constexpr double jump_s = 1e-3;    // s, duration of a jump, such as the compensation of backlash
constexpr double min_feed = 1e-9;  // per minute, smallest feed that a control accepts
constexpr double unknown_length = 0.01;  // mm or deg, assumed for a move from an unknown position
constexpr double word_tolerance = 1e-6;  // of a step, for equal words after rounding

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

  void write_text(std::string line);
  void write_auxiliary_words(std::size_t before);
  void write_units_and_feed_mode(const Block& block);
  void write_coordinates(const Block& block);
  int length_number(const Block& block) const;
  void write_spindle(const Block& block);
  void write_dwell(double seconds, const LineOrigin& origin);
  void write_moves(int index, const std::vector<CorrectedPoint>& points);
  void write_move(const Block& block, const Point& to, double seconds, const LineOrigin& origin);
  std::optional<Arc> rounded_arc(const Block& block, const Point& to) const;
  std::vector<CorrectedPoint> chord_points(const Block& block) const;
  std::vector<CorrectedPoint> half_turn_points(const Block& block) const;
  void write_plane(std::string_view letters);
  double feed_word(const FeedLength& distance, double seconds) const;
  double word_step(int joint) const;
  double word_offset(int joint) const;
  bool is_at_words(const AxisVector& words) const;
  AxisVector rounded_words(const AxisVector& position) const;
  AxisVector in_program_units(AxisVector words) const;

  const Path& path_;
  const NcOptions& control_;
  const RewriteOptions& options_;
  RewrittenProgram program_;
  std::vector<NcItem> items_;
  const std::optional<ProgramZero> zero_;
  std::optional<Coordinates> coordinates_;
  int length_number_ = 0;                    ///< H number under G43.4
  std::optional<AxisVector> current_words_;  ///< words of the current position, if known
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
  write_text("(corrected program)");
  write_text("G17 G90 G91.1 G54");
  if (path.blocks.empty()) write_text("G49");
}

void NcRewriter::write_text(std::string line) {
  items_.push_back(std::move(line));
  program_.line_origins.emplace_back();
}

void NcRewriter::write_auxiliary_words(std::size_t before) {
  while (auxiliary_words_written_ < path_.auxiliary_words.size() &&
         path_.auxiliary_words[auxiliary_words_written_].before <= before)
    write_text(path_.auxiliary_words[auxiliary_words_written_++].text);
}

void NcRewriter::write_units_and_feed_mode(const Block& block) {
  if (inch_ != block.inch) write_text(block.inch ? "G20" : "G21");
  if (inverse_time_ != block.inverse_time) write_text(block.inverse_time ? "G93" : "G94");
  inch_ = block.inch;
  inverse_time_ = block.inverse_time;
}

void NcRewriter::write_coordinates(const Block& block) {
  const int length_number = block.coordinates == Coordinates::Tip ? this->length_number(block) : 0;
  if (coordinates_ == block.coordinates && length_number_ == length_number) return;
  const bool is_first = !coordinates_;
  coordinates_ = block.coordinates;
  length_number_ = length_number;
  // At the start the position is known. After a change of coordinates it depends on corrections
  // that are not known here.
  current_words_ = is_first ? std::optional(rounded_words(block.start)) : std::nullopt;
  if (coordinates_ == Coordinates::Axis) return write_text("G49");
  write_text(fmt::format("G43.4 H{}", length_number));
}

/// Returns the H number of the tool whose tip a block commands.
int NcRewriter::length_number(const Block& block) const {
  if (control_.tool_length.empty())
    throw std::invalid_argument("expected a tool length for G43.4 H");
  if (control_.control_by_h.contains(block.tool_length)) return block.tool_length;
  // A tool table with many tools has one chain.
  return control_.control_by_h.size() == 1 ? control_.control_by_h.begin()->first
                                           : control_.tool_length.begin()->first;
}

void NcRewriter::write_spindle(const Block& block) {
  if (spindle_ < 0 || !(block.end_s > block.start_s)) return;
  const double rate = (block.end[spindle_] - block.start[spindle_]) / (block.end_s - block.start_s);
  // The angle is a sum over many turns; the rounding that remains in its rate is no change of
  // speed. 1e-5 rpm is far below what a spindle holds.
  const double rpm = std::round(rate / units::rpm * 1e6) / 1e6;
  if (std::abs(rpm - rpm_) <= 1e-5) return;
  rpm_ = rpm;
  write_text(rpm == 0.0 ? "M5"
                        : fmt::format("S{} M{}", nc_number(std::abs(rpm), 6), rpm > 0 ? 3 : 4));
}

void NcRewriter::write_dwell(double seconds, const LineOrigin& origin) {
  if (!(seconds > 0.0)) return;
  write_text("G4 P" + nc_number(seconds));
  program_.line_origins.back() = origin;
}

/// Returns the resolution of a word, mm (in an inch program too) or rad.
double NcRewriter::word_step(int joint) const {
  if (control_.axes[std::size_t(joint)].motion != Motion::Linear) return options_.word_rad;
  if (inch_ != true) return options_.word_mm;
  // 1e-9 keeps a resolution that is an exact power of ten inches from falling to the next lower
  // one.
  return std::pow(10.0, std::floor(std::log10(options_.word_mm / units::inch) + 1e-9)) *
         units::inch;
}

/// Returns the offset that G54 and the program zero add to a word in the current coordinates.
double NcRewriter::word_offset(int joint) const {
  const AxisVector& g54 = control_.work_offset[0];
  const char name = control_.axes[std::size_t(joint)].name;
  const double zero_correction =
      name >= 'X' && name <= 'Z' ? offset_correction(zero_, *coordinates_)[name - 'X'] : 0.0;
  return (g54.size() > 0 ? g54[joint] : 0.0) + zero_correction;
}

// Words are written in degrees, so rotary positions are rounded in degrees, not radians.
AxisVector NcRewriter::rounded_words(const AxisVector& position) const {
  AxisVector words = position;
  for (int j = 0; j < int(words.size()); ++j) {
    const double unit = control_.axes[std::size_t(j)].motion == Motion::Linear ? 1.0 : units::deg;
    const double step = word_step(j) / unit;
    const double value = (words[j] - word_offset(j)) / unit;
    words[j] = std::round(value / step) * step * unit;
  }
  return words;
}

AxisVector NcRewriter::in_program_units(AxisVector words) const {
  if (inch_ == true)
    for (int j = 0; j < int(words.size()); ++j)
      if (control_.axes[std::size_t(j)].motion == Motion::Linear) words[j] /= units::inch;
  return words;
}

bool NcRewriter::is_at_words(const AxisVector& words) const {
  if (!current_words_) return false;
  for (int j = 0; j < int(words.size()); ++j) {
    if (control_.axes[std::size_t(j)].motion == Motion::Spindle || j == spindle_) continue;
    if (std::abs(words[j] - (*current_words_)[j]) > word_tolerance * word_step(j)) return false;
  }
  return true;
}

double NcRewriter::feed_word(const FeedLength& distance, double seconds) const {
  if (inverse_time_ == true) return std::max(min_feed, 60.0 / seconds);
  const double unit = distance.linear && inch_ == true ? units::inch : 1.0;
  return std::max(min_feed, distance.length / unit / seconds * 60.0);
}

void NcRewriter::write_plane(std::string_view letters) {
  if (plane_ == letters) return;
  plane_ = letters;
  write_text(letters == "IJ" ? "G17" : letters == "KI" ? "G18" : "G19");
}

/// Returns the arc to a point that its rounded words define; nothing if they define only a line.
std::optional<Arc> NcRewriter::rounded_arc(const Block& block, const Point& to) const {
  if (!to.centre || !current_words_) return std::nullopt;
  const Arc& arc = path_.arcs[block.shape];
  const double step = word_step(arc.first);
  ArcGeometry geometry;
  geometry.clockwise = arc.sweep < 0.0;
  for (int k = 0; k < 2; ++k) {
    const int j = k == 0 ? arc.first : arc.second;
    geometry.start[k] = (*current_words_)[j];
    geometry.end[k] = to.words[j];
    const double centre = (*to.centre)[k] - word_offset(j);
    // I J K are relative to the start, so the offset from the start is rounded.
    geometry.centre[k] = geometry.start[k] + std::round((centre - geometry.start[k]) / step) * step;
  }
  // Steps of a step; a smaller arc may have lost its sense of rotation by rounding.
  constexpr double min_steps = 5.0;
  if ((geometry.end - geometry.start).norm() < min_steps * step ||
      (geometry.centre - geometry.start).norm() < min_steps * step)
    return std::nullopt;
  Arc result = arc_through(geometry);
  result.first = arc.first;
  result.second = arc.second;
  return result;
}

void NcRewriter::write_move(const Block& block, const Point& to, double seconds,
                            const LineOrigin& origin) {
  NcMove move{block.interpolation == Interpolation::Rapid, in_program_units(to.words), 0.0, {}};
  const std::optional<Arc> arc = rounded_arc(block, to);
  if (arc) {
    const char first_axis = control_.axes[std::size_t(arc->first)].name;
    const std::string letters = first_axis == 'X' ? "IJ" : first_axis == 'Z' ? "KI" : "JK";
    write_plane(letters);
    const Vector2d start((*current_words_)[arc->first], (*current_words_)[arc->second]);
    move.arc = {arc->sweep < 0.0, letters,
                (arc->centre - start) / (inch_ == true ? units::inch : 1.0)};
  }
  if (!move.rapid) {
    FeedLength distance =
        feed_length(control_.axes, current_words_ ? *current_words_ : rounded_words(block.start),
                    to.words, arc ? &*arc : nullptr);
    // From an unknown position the computed length may be nearly zero. A minimum keeps the feed
    // from becoming a crawl.
    if (!current_words_) distance.length = std::max(distance.length, unknown_length);
    move.feed = feed_word(distance, seconds);
  }
  items_.push_back(std::move(move));
  program_.line_origins.push_back(origin);
  current_words_ = to.words;
}

/// Writes the parts of a block. A part that moves by less than one step gives its time to the next
/// part; the last one becomes a dwell.
void NcRewriter::write_moves(int index, const std::vector<CorrectedPoint>& points) {
  const Block& block = path_.blocks[std::size_t(index)];
  const bool rapid = block.interpolation == Interpolation::Rapid;
  const double duration = block.end_s - block.start_s;
  double u = 0.0, jumps_s = 0.0;  // jumps_s: time taken by jumps
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Point to{points[k].u, rounded_words(points[k].at), points[k].centre};
    const bool is_still = is_at_words(to.words);
    const LineOrigin origin{index, u, to.u};
    if (to.u == u && !rapid) {
      if (is_still) continue;
      // A jump takes at most half of the time to the next point, so that some is left for the
      // motion.
      const double next_s = k + 1 < points.size() ? (points[k + 1].u - u) * duration : 2 * jump_s;
      const double seconds = std::min(jump_s, 0.5 * next_s);
      jumps_s += seconds;
      write_move(block, to, seconds, origin);
      continue;
    }
    if (is_still && k + 1 < points.size() && points[k + 1].u > to.u) continue;
    const double seconds = (to.u - u) * duration - jumps_s;
    if (!is_still)
      write_move(block, to, seconds, origin);
    else if (!rapid)
      write_dwell(seconds, origin);
    u = to.u;
    jumps_s = 0.0;
  }
}

/// Splits an arc in a plane without a G code into chords that deviate by at most half a step of a
/// word.
std::vector<CorrectedPoint> NcRewriter::chord_points(const Block& block) const {
  const Arc& arc = path_.arcs[block.shape];
  const double radius = arc.radius + std::max(0.0, arc.growth);
  // A chord of this angle has a sagitta of half a step.
  const double chord_angle = 2 * std::acos(1.0 - std::min(1.0, 0.5 * options_.word_mm / radius));
  // The limit of 1e6 chords bounds memory.
  const int n = std::max(2, int(std::ceil(std::min(1e6, std::abs(arc.sweep) / chord_angle))));
  std::vector<CorrectedPoint> points;
  for (int k = 1; k <= n; ++k)
    points.push_back({double(k) / n, position(path_, block, double(k) / n), {}, {}});
  return points;
}

/// Splits an arc that ends near its start, or exceeds one turn, into parts of at most half a turn,
/// because end and centre alone define less than one whole turn.
std::vector<CorrectedPoint> NcRewriter::half_turn_points(const Block& block) const {
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
  if (is_cubic(block))
    throw std::invalid_argument("expected a path of cubics only, or without cubics");
  write_auxiliary_words(std::size_t(index));
  write_units_and_feed_mode(block);
  write_coordinates(block);
  write_spindle(block);
  if (block.interpolation == Interpolation::Dwell)
    return write_dwell(block.end_s - block.start_s, {index, 0.0, 1.0});
  if (!points.empty()) return write_moves(index, points);
  if (block.interpolation == Interpolation::Arc && path_.arcs[block.shape].plane_rotation >= 0)
    return write_moves(index, chord_points(block));
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block.shape];
    const Vector2d chord(block.end[arc.first] - block.start[arc.first],
                         block.end[arc.second] - block.start[arc.second]);
    // Fraction of the radius. A shorter chord would cost two digits of the direction of the end.
    constexpr double max_closing_gap = 0.01;
    if (std::abs(arc.sweep) > pi && chord.norm() < max_closing_gap * arc.radius)
      return write_moves(index, half_turn_points(block));
    if (std::abs(arc.sweep) > 2 * pi) return write_moves(index, half_turn_points(block));
  }
  CorrectedPoint end{1.0, block.end, {}, {}};
  if (block.interpolation == Interpolation::Arc) end.centre = path_.arcs[block.shape].centre;
  // The first move goes to rounded words. Otherwise the displacement by rounding would count as the
  // length of a block that only rotates.
  if (!current_words_ && block.interpolation != Interpolation::Rapid)
    return write_moves(index, {{0.0, block.start, {}, {}}, end});
  write_moves(index, {end});
}

RewrittenProgram NcRewriter::program() {
  write_auxiliary_words(path_.blocks.size());
  if (rpm_ != 0.0) write_text("M5");
  write_text("M2");
  // More digits than the resolution has, so that writing does not round again.
  program_.text =
      write_nc(items_, control_.axes,
               {.format = {11, 9},
                .inverse_time = std::any_of(path_.blocks.begin(), path_.blocks.end(),
                                            [](auto& block) { return block.inverse_time; }),
                .feed_digits = 9});
  return std::move(program_);
}

}  // namespace

RewrittenProgram rewrite_program(const Path& path,
                                 std::span<const std::vector<CorrectedPoint>> corrected,
                                 const NcOptions& control, const RewriteOptions& options) {
  check_corrected(path, corrected);
  // Only eleven decimals are written, so a finer resolution could not be represented.
  if (!(options.word_mm >= 1e-9) || !(options.word_rad >= 1e-9 * units::deg))
    throw std::invalid_argument("expected a word resolution of at least 1e-9");
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return rewritten_pvt(path, corrected, control);
  NcRewriter writer(path, control, options);
  for (std::size_t i = 0; i < path.blocks.size(); ++i) writer.block(int(i), corrected[i]);
  return writer.program();
}

}  // namespace abbe::sim::program
