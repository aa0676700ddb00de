#include "sim/program/path.h"

#include <algorithm>
#include <cmath>
#include <regex>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim::program {

std::string to_text(const Assumption& assumption) {
  std::string place;
  if (assumption.line > 0)
    place = assumption.file.empty() ? fmt::format("line {}: ", assumption.line)
                                    : fmt::format("{}:{}: ", assumption.file, assumption.line);
  const char* or_option = assumption.key.empty() || assumption.option.empty() ? "" : ", ";
  return fmt::format("{}{} ({}{}{})", place, assumption.text, assumption.key, or_option,
                     assumption.option);
}

namespace {

using Found = std::match_results<std::string::const_iterator>;

// Length of a tool comment; std::regex recurses over the text, so it must be bounded.
constexpr std::size_t longest = 200;

// A length: 10, 10., .5, 1/2 or 1-1/2.
const std::string a_length = "([0-9]+-[0-9]+/[0-9]+|[0-9]+/[0-9]+|[0-9]+\\.?[0-9]*|\\.[0-9]+)";
const std::string a_unit = "(MM|INCHES|INCH|IN\\b|\")";

std::regex pattern(const std::string& text) { return std::regex(text, std::regex::optimize); }

// Returns the first match.
std::optional<Found> found(const std::string& text, const std::regex& wanted) {
  Found match;
  if (!std::regex_search(text, match, wanted)) return std::nullopt;
  return match;
}

bool has(const std::string& text, const std::regex& wanted) {
  return std::regex_search(text, wanted);
}

// A zero denominator gives 0, which the caller rejects as a diameter.
double quotient(const std::string& text, std::size_t slash) {
  const double below = std::stod(text.substr(slash + 1));
  return below > 0.0 ? std::stod(text.substr(0, slash)) / below : 0.0;
}

double length_of(const std::string& text) {
  if (text.size() > 12) return 0.0;  // no tool has such a length
  const std::size_t dash = text.find('-');
  if (dash != std::string::npos)
    return length_of(text.substr(0, dash)) + length_of(text.substr(dash + 1));
  const std::size_t slash = text.find('/');
  return slash == std::string::npos ? std::stod(text) : quotient(text, slash);
}

std::optional<double> unit_of_words(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "MM" ? 1.0 : units::inch;
}

// Returns the tool number, from T or from TOOL.
std::optional<int> number_in(const std::string& text) {
  static const std::regex t = pattern("\\bT ?0*([0-9]{1,6})\\b");
  static const std::regex tool =
      pattern("\\bTOOL *(?:NO\\.?|NUMBER|#)? *[-:=#]? *-? *0*([0-9]{1,6})\\b(?![./])");
  for (const std::regex* wanted : {&t, &tool})
    if (const auto match = found(text, *wanted)) return std::stoi((*match)[1].str());
  return std::nullopt;
}

/// A bare D is a diameter only where the comment mentions a tool and no register.
std::optional<double> bare_diameter(const std::string& text, const std::optional<int>& number) {
  static const std::regex bare = pattern("(?:^|[^A-Z0-9])D ?([0-9]+\\.?[0-9]*)(?![0-9A-Z])");
  static const std::regex register_of = pattern("\\bH ?[0-9]|\\||\\bOFF|\\bCOMP|\\bWEAR");
  static const std::regex tool =
      pattern("\\bT ?[0-9]|TOOL|MILL|CUTTER|BALL|FLAT|BULL|^ *D ?[0-9.]+ *$");
  const auto match = found(text, bare);
  if (!match || has(text, register_of) || !has(text, tool)) return std::nullopt;
  const double length = length_of((*match)[1].str());
  // D1 beside T1 is the register of that tool, not a diameter of 1.
  if (number && length == double(*number)) return std::nullopt;
  return length;
}

/// Finds the diameter, and the unit and corner radius stated with it. The patterns are tried from
/// the most explicit to the vaguest.
std::optional<CutterData> with_cutter_diameter(const std::string& text, CutterData words) {
  static const std::regex letter = pattern("\\bD *[=:] *" + a_length);
  static const std::regex written =
      pattern("\\bDIA(?:M(?:ETER)?)?\\b\\.? *[-=:]? *D?" + a_length + " *" + a_unit + "?");
  static const std::regex sign = pattern("(?:\xC3\x98|\xC3\xB8|\xE2\x8C\x80) ?" + a_length);
  static const std::regex code = pattern("(?:^|[^A-Z0-9])D ?" + a_length + "[ _-]?R ?" + a_length);
  static const std::regex mill =
      pattern(a_length + " *" + a_unit +
              " *(?:[A-Z0-9]+ +){0,2}?(?:END ?-?MILL|BALL|FLAT|BULL|MILL\\b|CUTTER)");
  static const std::regex kind =
      pattern(a_length + " +(?:FLAT|BALL|BULL|SQUARE)[A-Z]* *(?:NOSED?|END)? *-?(?:END)? *-?MILL");
  static const std::regex braces = pattern("MILL.*\\{ *" + a_length + " *" + a_unit + " *\\}");
  if (const auto both = found(text, code)) {
    words.diameter = length_of((*both)[1].str());
    words.corner_radius = length_of((*both)[2].str());
    return words;
  }
  for (const std::regex* wanted : {&letter, &written, &sign, &braces, &mill, &kind})
    if (const auto match = found(text, *wanted)) {
      words.diameter = length_of((*match)[1].str());
      if (match->size() > 2) words.unit_mm = unit_of_words((*match)[2].str());
      return words;
    }
  if (const auto bare = bare_diameter(text, words.number)) {
    words.diameter = *bare;
    return words;
  }
  return std::nullopt;
}

std::optional<double> corner_radius_in(const std::string& text) {
  static const std::regex radius =
      pattern("\\b(?:CR|R|(?:TIP|CORNER) *RAD(?:IUS)?) *[=:] *" + a_length + "|\\bR ?" + a_length);
  const auto match = found(text, radius);
  if (!match) return std::nullopt;
  return length_of((*match)[(*match)[1].matched ? 1 : 2].str());
}

CutterData::End end_in(const std::string& text) {
  static const std::regex ball = pattern("\\bBALL"), flat = pattern("\\bFLAT\\b|\\bSQUARE\\b");
  if (has(text, ball)) return CutterData::End::Ball;
  return has(text, flat) ? CutterData::End::Flat : CutterData::End::Unspecified;
}

}  // namespace

std::optional<CutterData> parse_cutter_comment(std::string_view comment) {
  if (comment.size() > longest || comment.find_first_of("0123456789") == std::string_view::npos)
    return std::nullopt;
  std::string text(comment);
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = char(c - 'a' + 'A');
  const auto words = with_cutter_diameter(text, {.number = number_in(text)});
  if (!words || !(words->diameter > 0.0)) return std::nullopt;
  CutterData all = *words;
  if (!all.corner_radius) all.corner_radius = corner_radius_in(text);
  all.end = end_in(text);
  return all;
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

Arc arc_through(const ArcGeometry& words) {
  // mm; ends this close make a full circle, see the README of this folder
  constexpr double same_point = 1e-8;
  const Eigen::Vector2d from = words.start - words.centre, to = words.end - words.centre;
  Arc arc;
  arc.centre = words.centre;
  arc.radius = from.norm();
  arc.growth = to.norm() - arc.radius;
  arc.start_angle = std::atan2(from.y(), from.x());
  double sweep = std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  // A full circle has an end at its start; without this test rounding would decide between a full
  // turn and none.
  const bool whole = (words.end - words.start).norm() < same_point;
  if (!words.clockwise && (sweep <= 0 || whole)) sweep = whole ? 2 * pi : sweep + 2 * pi;
  if (words.clockwise && (sweep >= 0 || whole)) sweep = whole ? -2 * pi : sweep - 2 * pi;
  arc.sweep = sweep;
  return arc;
}

namespace {

/// Applies `change` to the coordinates of an arc in its plane and along its normal.
template <typename Vector, typename Change>
void transform_in_plane(const Path& path, const Arc& arc, Vector& q, const Change& change) {
  if (arc.turned < 0) {
    Eigen::Vector3d p(q[arc.first], q[arc.second], 0.0);
    change(p);
    q[arc.first] = p.x();
    q[arc.second] = p.y();
    return;
  }
  const Eigen::Matrix3d& R = path.turns[std::size_t(arc.turned)];
  Eigen::Vector3d p = R.transpose() * Eigen::Vector3d(q[arc.first], q[arc.second], q[arc.third]);
  change(p);
  p = R * p;
  q[arc.first] = p.x();
  q[arc.second] = p.y();
  q[arc.third] = p.z();
}

/// Angles at which X, Y or Z reverses on an arc or helix in a rotated plane.
std::vector<double> turning_angles(const Path& path, const Block& block, const Arc& arc) {
  const Eigen::Matrix3d& R = path.turns[std::size_t(arc.turned)];
  const Eigen::Vector3d way(block.end[arc.first] - block.start[arc.first],
                            block.end[arc.second] - block.start[arc.second],
                            block.end[arc.third] - block.start[arc.third]);
  const double across = R.col(2).dot(way) / arc.sweep;  // per rad
  std::vector<double> found;
  for (int i = 0; i < 3; ++i) {
    // The axis moves by reach cos(angle - phase) plus a constant rate, and reverses only if the
    // rate is below reach.
    const double reach = arc.radius * std::hypot(R(i, 0), R(i, 1));
    if (!(std::abs(R(i, 2) * across) < reach)) continue;
    const double phase = std::atan2(R(i, 1), R(i, 0));
    const double lag = std::asin(R(i, 2) * across / reach);
    found.push_back(phase + lag);
    found.push_back(phase + pi - lag);
  }
  return found;
}

}  // namespace

// The cubic is written as the line plus its deviation, so that motion at constant speed stays
// straight up to the last bit.
AxisVector position(const Path& path, const Block& block, double u) {
  if (u <= 0.0) return block.start;
  if (u >= 1.0) return block.end;
  const AxisVector way = block.end - block.start;
  AxisVector q = block.start + u * way;
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    transform_in_plane(path, arc, q, [&](Eigen::Vector3d& p) { p.head<2>() = position(arc, u); });
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    const double duration = block.end_s - block.start_s;
    q += u * (1 - u) *
         ((1 - u) * (duration * cubic.start_velocity - way) -
          u * (duration * cubic.end_velocity - way));
  }
  return q;
}

std::vector<double> turning_points(const Path& path, const Block& block) {
  const Arc& arc = path.arcs[block.shape];
  // In a plane of joints both axes reverse at multiples of a quarter turn.
  const double quarter = 0.5 * pi;
  const double low = std::min(arc.start_angle, arc.start_angle + arc.sweep);
  const double high = std::max(arc.start_angle, arc.start_angle + arc.sweep);
  std::vector<double> u;
  if (arc.turned < 0)
    for (double k = std::ceil(low / quarter); k * quarter < high; ++k)
      u.push_back((k * quarter - arc.start_angle) / arc.sweep);
  else
    for (const double angle : turning_angles(path, block, arc))
      for (double k = std::ceil((low - angle) / (2 * pi)); angle + 2 * pi * k < high; ++k)
        u.push_back((angle + 2 * pi * k - arc.start_angle) / arc.sweep);
  return u;
}

namespace {

/// Copies the arc or cubic of a block, and nothing else, to the part.
void take_shape(Path& part, Block& block, const Path& path) {
  if (block.interpolation == Interpolation::Arc) {
    Arc arc = path.arcs[block.shape];
    if (arc.turned >= 0) {
      const Eigen::Matrix3d& turn = path.turns[std::size_t(arc.turned)];
      if (part.turns.empty() || part.turns.back() != turn) part.turns.push_back(turn);
      arc.turned = int(part.turns.size()) - 1;
    }
    block.shape = std::uint32_t(part.arcs.size());
    part.arcs.push_back(arc);
  } else if (block.interpolation == Interpolation::Cubic) {
    part.cubics.push_back(path.cubics[block.shape]);
    block.shape = std::uint32_t(part.cubics.size() - 1);
  }
}

}  // namespace

Path stretch_of(const Path& path, std::size_t first, std::size_t last) {
  Path part;
  part.file = path.file;
  part.more_files = path.more_files;
  part.blocks.assign(path.blocks.begin() + std::ptrdiff_t(first),
                     path.blocks.begin() + std::ptrdiff_t(last));
  // Auxiliary words are sorted by block. Those behind the last block belong to the part only if it
  // ends the path.
  const auto from =
      std::ranges::lower_bound(path.auxiliary_words, first, {}, &AuxiliaryWord::before);
  for (auto aside = from; aside != path.auxiliary_words.end(); ++aside) {
    if (aside->before >= last && last != path.blocks.size()) break;
    part.auxiliary_words.push_back({aside->before - first, aside->text});
  }
  part.unit_words = path.unit_words;
  for (Block& block : part.blocks) take_shape(part, block, path);
  for (const Block& block : part.blocks)
    part.motion_blocks += block.interpolation != Interpolation::Dwell;
  return part;
}

AxisVector velocity(const Path& path, const Block& block, double u) {
  const double duration = block.end_s - block.start_s;
  const AxisVector way = block.end - block.start;
  if (!(duration > 0.0)) return AxisVector::Zero(way.size());
  AxisVector rate = way / duration;
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
