#include "sim/program/path.h"

#include <algorithm>
#include <cmath>
#include <regex>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim::program {

std::string to_text(const Assumption& assumption) {
  std::string location;
  if (assumption.line > 0)
    location = assumption.file.empty() ? fmt::format("line {}: ", assumption.line)
                                       : fmt::format("{}:{}: ", assumption.file, assumption.line);
  const char* or_option = assumption.key.empty() || assumption.option.empty() ? "" : ", ";
  return fmt::format("{}{} ({}{}{})", location, assumption.text, assumption.key, or_option,
                     assumption.option);
}

namespace {

using Match = std::match_results<std::string::const_iterator>;

// std::regex recurses over the text, so the length of a comment must be bounded.
constexpr std::size_t max_comment_length = 200;

// Matches 10, 10., .5, 1/2 and 1-1/2.
const std::string length_pattern =
    "([0-9]+-[0-9]+/[0-9]+|[0-9]+/[0-9]+|[0-9]+\\.?[0-9]*|\\.[0-9]+)";
const std::string unit_pattern = "(MM|INCHES|INCH|IN\\b|\")";

std::regex make_machine(const std::string& text) { return std::regex(text, std::regex::optimize); }

std::optional<Match> first_match(const std::string& text, const std::regex& regex) {
  Match match;
  if (!std::regex_search(text, match, regex)) return std::nullopt;
  return match;
}

bool has_match(const std::string& text, const std::regex& regex) {
  return std::regex_search(text, regex);
}

// A zero denominator gives 0, which the caller rejects as a diameter.
double quotient(const std::string& text, std::size_t slash) {
  const double denominator = std::stod(text.substr(slash + 1));
  return denominator > 0.0 ? std::stod(text.substr(0, slash)) / denominator : 0.0;
}

double parse_length(const std::string& text) {
  if (text.size() > 12) return 0.0;  // no tool has such a length
  const std::size_t dash = text.find('-');
  if (dash != std::string::npos)
    return parse_length(text.substr(0, dash)) + parse_length(text.substr(dash + 1));
  const std::size_t slash = text.find('/');
  return slash == std::string::npos ? std::stod(text) : quotient(text, slash);
}

std::optional<double> parse_unit(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "MM" ? 1.0 : units::inch;
}

/// Returns the number after T or TOOL.
std::optional<int> find_tool_number(const std::string& text) {
  static const std::regex t_word = make_machine("\\bT ?0*([0-9]{1,6})\\b");
  static const std::regex tool_word =
      make_machine("\\bTOOL *(?:NO\\.?|NUMBER|#)? *[-:=#]? *-? *0*([0-9]{1,6})\\b(?![./])");
  for (const std::regex* regex : {&t_word, &tool_word})
    if (const auto match = first_match(text, *regex)) return std::stoi((*match)[1].str());
  return std::nullopt;
}

/// Returns the number after a bare D. It is a diameter only if the comment mentions a tool and no
/// register.
std::optional<double> bare_diameter(const std::string& text, const std::optional<int>& number) {
  static const std::regex bare_d = make_machine("(?:^|[^A-Z0-9])D ?([0-9]+\\.?[0-9]*)(?![0-9A-Z])");
  static const std::regex register_word = make_machine("\\bH ?[0-9]|\\||\\bOFF|\\bCOMP|\\bWEAR");
  static const std::regex tool_word =
      make_machine("\\bT ?[0-9]|TOOL|MILL|CUTTER|BALL|FLAT|BULL|^ *D ?[0-9.]+ *$");
  const auto match = first_match(text, bare_d);
  if (!match || has_match(text, register_word) || !has_match(text, tool_word)) return std::nullopt;
  const double length = parse_length((*match)[1].str());
  // D1 in a comment with T1 is the register of that tool, not a diameter of 1.
  if (number && length == double(*number)) return std::nullopt;
  return length;
}

/// Adds the diameter to `data`, with the unit and corner radius stated next to it; returns nothing
/// if the text gives no diameter. The patterns are tried from the most explicit to the vaguest.
std::optional<CutterData> add_diameter(const std::string& text, CutterData data) {
  static const std::regex d_letter = make_machine("\\bD *[=:] *" + length_pattern);
  static const std::regex dia_word = make_machine("\\bDIA(?:M(?:ETER)?)?\\b\\.? *[-=:]? *D?" +
                                                  length_pattern + " *" + unit_pattern + "?");
  static const std::regex diameter_sign =
      make_machine("(?:\xC3\x98|\xC3\xB8|\xE2\x8C\x80) ?" + length_pattern);
  static const std::regex d_and_r =
      make_machine("(?:^|[^A-Z0-9])D ?" + length_pattern + "[ _-]?R ?" + length_pattern);
  static const std::regex before_mill =
      make_machine(length_pattern + " *" + unit_pattern +
                   " *(?:[A-Z0-9]+ +){0,2}?(?:END ?-?MILL|BALL|FLAT|BULL|MILL\\b|CUTTER)");
  static const std::regex before_shape = make_machine(
      length_pattern + " +(?:FLAT|BALL|BULL|SQUARE)[A-Z]* *(?:NOSED?|END)? *-?(?:END)? *-?MILL");
  static const std::regex braced =
      make_machine("MILL.*\\{ *" + length_pattern + " *" + unit_pattern + " *\\}");
  if (const auto match = first_match(text, d_and_r)) {
    data.diameter = parse_length((*match)[1].str());
    data.corner_radius = parse_length((*match)[2].str());
    return data;
  }
  for (const std::regex* regex :
       {&d_letter, &dia_word, &diameter_sign, &braced, &before_mill, &before_shape})
    if (const auto match = first_match(text, *regex)) {
      data.diameter = parse_length((*match)[1].str());
      if (match->size() > 2) data.unit_mm = parse_unit((*match)[2].str());
      return data;
    }
  if (const auto bare_d = bare_diameter(text, data.number)) {
    data.diameter = *bare_d;
    return data;
  }
  return std::nullopt;
}

std::optional<double> find_corner_radius(const std::string& text) {
  static const std::regex radius = make_machine("\\b(?:CR|R|(?:TIP|CORNER) *RAD(?:IUS)?) *[=:] *" +
                                                length_pattern + "|\\bR ?" + length_pattern);
  const auto match = first_match(text, radius);
  if (!match) return std::nullopt;
  return parse_length((*match)[(*match)[1].matched ? 1 : 2].str());
}

CutterData::End find_end(const std::string& text) {
  static const std::regex ball = make_machine("\\bBALL"),
                          flat = make_machine("\\bFLAT\\b|\\bSQUARE\\b");
  if (has_match(text, ball)) return CutterData::End::Ball;
  return has_match(text, flat) ? CutterData::End::Flat : CutterData::End::Unspecified;
}

}  // namespace

std::optional<CutterData> parse_cutter_comment(std::string_view comment) {
  if (comment.size() > max_comment_length || comment.find_first_of("0123456789") == comment.npos)
    return std::nullopt;
  std::string text(comment);
  for (char& c : text) c = c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c;
  CutterData cutter;
  cutter.number = find_tool_number(text);
  const auto data = add_diameter(text, cutter);
  if (!data || !(data->diameter > 0.0)) return std::nullopt;
  cutter = *data;
  if (!cutter.corner_radius) cutter.corner_radius = find_corner_radius(text);
  cutter.end = find_end(text);
  return cutter;
}

bool is_feed(const Block& block) {
  return block.interpolation != Interpolation::Rapid && block.interpolation != Interpolation::Dwell;
}

using kinematics::AxisVector;

Eigen::Vector2d position(const Arc& arc, double u) {
  const double angle = arc.start_angle + u * arc.sweep;
  const double radius = arc.radius + u * arc.growth;
  return {arc.centre.x() + radius * std::cos(angle), arc.centre.y() + radius * std::sin(angle)};
}

Arc arc_through(const ArcGeometry& geometry) {
  // mm; ends closer than this make a full circle, see the README of this folder
  constexpr double full_circle_chord = 1e-8;
  const Eigen::Vector2d from = geometry.start - geometry.centre,
                        to = geometry.end - geometry.centre;
  Arc arc;
  arc.centre = geometry.centre;
  arc.radius = from.norm();
  arc.growth = to.norm() - arc.radius;
  arc.start_angle = std::atan2(from.y(), from.x());
  double sweep = std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  // A full circle has an end at its start; without this test rounding would decide between a full
  // turn and none.
  const bool is_full_circle = (geometry.end - geometry.start).norm() < full_circle_chord;
  if (!geometry.clockwise && (sweep <= 0 || is_full_circle))
    sweep = is_full_circle ? 2 * pi : sweep + 2 * pi;
  if (geometry.clockwise && (sweep >= 0 || is_full_circle))
    sweep = is_full_circle ? -2 * pi : sweep - 2 * pi;
  arc.sweep = sweep;
  return arc;
}

namespace {

/// Replaces the coordinates (or their rates) of an arc: `change` receives the two in its plane and
/// the one along its normal.
template <typename Vector, typename Change>
void transform_in_plane(const Path& path, const Arc& arc, Vector& q, const Change& change) {
  if (arc.plane_rotation < 0) {
    Eigen::Vector3d p(q[arc.first], q[arc.second], 0.0);
    change(p);
    q[arc.first] = p.x();
    q[arc.second] = p.y();
    return;
  }
  const Eigen::Matrix3d& R = path.plane_rotations[std::size_t(arc.plane_rotation)];
  Eigen::Vector3d p = R.transpose() * Eigen::Vector3d(q[arc.first], q[arc.second], q[arc.third]);
  change(p);
  p = R * p;
  q[arc.first] = p.x();
  q[arc.second] = p.y();
  q[arc.third] = p.z();
}

/// Returns the angles at which X, Y or Z reverses on an arc or helix in a rotated plane.
std::vector<double> reversal_angles(const Path& path, const Block& block, const Arc& arc) {
  const Eigen::Matrix3d& R = path.plane_rotations[std::size_t(arc.plane_rotation)];
  const Eigen::Vector3d displacement(block.end[arc.first] - block.start[arc.first],
                                     block.end[arc.second] - block.start[arc.second],
                                     block.end[arc.third] - block.start[arc.third]);
  const double normal_rate = R.col(2).dot(displacement) / arc.sweep;  // per rad
  std::vector<double> angles;
  for (int i = 0; i < 3; ++i) {
    // The axis moves by amplitude cos(angle - phase) plus a constant rate. It reverses only if that
    // rate is below the amplitude.
    const double amplitude = arc.radius * std::hypot(R(i, 0), R(i, 1));
    if (!(std::abs(R(i, 2) * normal_rate) < amplitude)) continue;
    const double phase = std::atan2(R(i, 1), R(i, 0));
    const double lag = std::asin(R(i, 2) * normal_rate / amplitude);
    angles.push_back(phase + lag);
    angles.push_back(phase + pi - lag);
  }
  return angles;
}

}  // namespace

// The cubic is written as the line plus its deviation, so that motion at constant speed stays
// straight up to the last bit.
AxisVector position(const Path& path, const Block& block, double u) {
  if (u <= 0.0) return block.start;
  if (u >= 1.0) return block.end;
  const AxisVector displacement = block.end - block.start;
  AxisVector q = block.start + u * displacement;
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    transform_in_plane(path, arc, q, [&](Eigen::Vector3d& p) { p.head<2>() = position(arc, u); });
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    const double duration = block.end_s - block.start_s;
    q += u * (1 - u) *
         ((1 - u) * (duration * cubic.start_velocity - displacement) -
          u * (duration * cubic.end_velocity - displacement));
  }
  return q;
}

std::vector<double> reversal_points(const Path& path, const Block& block) {
  const Arc& arc = path.arcs[block.shape];
  // In a plane of joints both axes reverse at multiples of a quarter turn.
  const double quarter = 0.5 * pi;
  const double low = std::min(arc.start_angle, arc.start_angle + arc.sweep);
  const double high = std::max(arc.start_angle, arc.start_angle + arc.sweep);
  std::vector<double> u;
  if (arc.plane_rotation < 0)
    for (double k = std::ceil(low / quarter); k * quarter < high; ++k)
      u.push_back((k * quarter - arc.start_angle) / arc.sweep);
  else
    for (const double angle : reversal_angles(path, block, arc))
      for (double k = std::ceil((low - angle) / (2 * pi)); angle + 2 * pi * k < high; ++k)
        u.push_back((angle + 2 * pi * k - arc.start_angle) / arc.sweep);
  return u;
}

namespace {

/// Copies the arc or cubic of `block` from `path` to `segment` and updates its index.
void copy_shape(Path& segment, Block& block, const Path& path) {
  if (block.interpolation == Interpolation::Arc) {
    Arc arc = path.arcs[block.shape];
    if (arc.plane_rotation >= 0) {
      const Eigen::Matrix3d& rotation = path.plane_rotations[std::size_t(arc.plane_rotation)];
      if (segment.plane_rotations.empty() || segment.plane_rotations.back() != rotation)
        segment.plane_rotations.push_back(rotation);
      arc.plane_rotation = int(segment.plane_rotations.size()) - 1;
    }
    block.shape = std::uint32_t(segment.arcs.size());
    segment.arcs.push_back(arc);
  } else if (block.interpolation == Interpolation::Cubic) {
    segment.cubics.push_back(path.cubics[block.shape]);
    block.shape = std::uint32_t(segment.cubics.size() - 1);
  }
}

}  // namespace

Path path_segment(const Path& path, std::size_t first, std::size_t last) {
  Path segment;
  segment.file = path.file;
  segment.subprogram_files = path.subprogram_files;
  segment.blocks.assign(path.blocks.begin() + std::ptrdiff_t(first),
                        path.blocks.begin() + std::ptrdiff_t(last));
  // Auxiliary words are sorted by block. Those after the last block belong to the segment only if
  // it ends the path.
  const auto from =
      std::ranges::lower_bound(path.auxiliary_words, first, {}, &AuxiliaryWord::before);
  for (auto word = from; word != path.auxiliary_words.end(); ++word) {
    if (word->before >= last && last != path.blocks.size()) break;
    segment.auxiliary_words.push_back({word->before - first, word->text});
  }
  segment.unit_words = path.unit_words;
  for (Block& block : segment.blocks) copy_shape(segment, block, path);
  for (const Block& block : segment.blocks)
    segment.motion_blocks += block.interpolation != Interpolation::Dwell;
  return segment;
}

// The derivative of `position` with respect to time.
AxisVector velocity(const Path& path, const Block& block, double u) {
  const double duration = block.end_s - block.start_s;
  const AxisVector displacement = block.end - block.start;
  if (!(duration > 0.0)) return AxisVector::Zero(displacement.size());
  AxisVector rate = displacement / duration;
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    const double angle = arc.start_angle + u * arc.sweep;
    const double radius = arc.radius + u * arc.growth;
    const double c = std::cos(angle), s = std::sin(angle);
    transform_in_plane(path, arc, rate, [&](Eigen::Vector3d& v) {
      v.x() = (arc.growth * c - radius * arc.sweep * s) / duration;
      v.y() = (arc.growth * s + radius * arc.sweep * c) / duration;
    });
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    if (u <= 0.0) return cubic.start_velocity;
    if (u >= 1.0) return cubic.end_velocity;
    rate += (1 - u) * (1 - 3 * u) * (cubic.start_velocity - rate) -
            u * (2 - 3 * u) * (cubic.end_velocity - rate);
  }
  return rate;
}

}  // namespace abbe::sim::program
