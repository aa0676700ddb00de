#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_machine.h"

/// The words of a block of motion.
namespace abbe::sim::dialects::heidenhain {

using program::Feed;
using program::FeedMode;

namespace {

constexpr double least_feed = 1e-9;  // per minute; keeps every duration finite

bool is_axis_letter(char c) {
  return c >= 'A' && c <= 'Z' && std::string_view("XYZABCUVW").find(c) != std::string_view::npos;
}

}  // namespace

/// X+10, IX+10
bool Machine::read_axis(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool step = name.size() == 2 && name[0] == 'I';
  if ((name.size() != 1 && !step) || !is_axis_letter(name.back())) return false;
  const char letter = name.back();
  const double number = words.value();
  const Cause cause = words.cause(from);
  const int joint = joint_of(letter, cause);
  auto& word = move.axes[std::size_t(letter - 'A')];
  if (word) refuse(cause, fmt::format("{} once in a block", letter));
  word = Valued{number * (canon_.is_linear(joint) ? unit() : units::deg), step, cause};
  return true;
}

/// PR, PA, DR, R with a radius, NX ... TZ
bool Machine::read_polar(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool step = !name.empty() && name[0] == 'I';
  const std::string_view bare = std::string_view(name).substr(step ? 1 : 0);
  if (bare == "PR" || bare == "PA") {
    const double number = words.value();
    auto& word = bare == "PR" ? move.pr : move.pa;
    if (word) words.refuse(from, fmt::format("{} once in a block", bare));
    word = Valued{number * (bare == "PR" ? unit() : units::deg), step, words.cause(from)};
    return true;
  }
  if (name == "DR") {
    words.cursor.skip_blanks();
    const char sign = words.cursor.here();
    if ((sign != '+' && sign != '-') || is_digit(words.cursor.next()))
      words.refuse(from, "DR+ or DR-");
    ++words.cursor.at;
    if (move.clockwise) words.refuse(from, "DR once in a block");
    move.clockwise = sign == '-';
    return true;
  }
  if (name.size() == 2 && (name[0] == 'N' || name[0] == 'T') && name[1] >= 'X' && name[1] <= 'Z') {
    if (move.keyword != "LN") words.refuse(from, "LN before " + name);
    auto& word = (name[0] == 'N' ? move.normal : move.direction)[std::size_t(name[1] - 'X')];
    if (word) words.refuse(from, name + " once in a block");
    word = words.value();
    return true;
  }
  return false;
}

Machine::FeedValue Machine::feed_value(std::string kind, Words& words, std::size_t from) const {
  if (kind.empty() && !words.has_value()) kind = words.name();
  if (kind == "MAX") return {FeedWord::Rapid};
  if (kind == "AUTO") {
    if (!(tool_feed_ > 0)) words.refuse(from, "F in a TOOL CALL before F AUTO");
    return {FeedWord::OfTool, tool_feed_};
  }
  if (!kind.empty() && kind != "U") {
    refuse_if_named("F" + kind, words.cause(from));
    words.refuse(from, "a feed: a number, FMAX, F AUTO or FU");
  }
  words.cursor.skip_blanks();
  const std::size_t at = words.cursor.at;
  const double value = words.value();
  if (!(value >= least_feed)) words.refuse(at, "a feed above zero");
  return {kind.empty() ? FeedWord::Number : FeedWord::PerTurn, value};
}

/// R0, RL, RR; of CR the radius
void Machine::read_side(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool had_side = move.side.has_value();
  if (name == "RL" || name == "RR") {
    move.side = name[1];
  } else if (words.cursor.here() == '0' && !is_digit(words.cursor.next()) &&
             words.cursor.next() != '.') {
    ++words.cursor.at;
    move.side = '0';
  } else {
    if (move.keyword != "CR") words.refuse(from, "R0, RL or RR");
    if (move.radius) words.refuse(from, "the radius R once in a block");
    const double number = words.value();
    move.radius = Valued{number * unit(), false, words.cause(from)};
    return;
  }
  if (had_side) words.refuse(from, "one of R0, RL and RR in a block");
  move.side_cause = words.cause(from);
}

Machine::Move Machine::read_move(const std::string& keyword, std::size_t from, Words& words) {
  Move move;
  move.keyword = keyword;
  move.cause = keyword.empty() ? Cause{int(from) + 1, words.cursor.cell(from)} : words.cause(from);
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name.empty()) words.refuse(at, "a word of Klartext");
    if (name == "M") {
      if (move.functions.size() == 8) words.refuse(at, "at most 8 M words in a block");
      M m;
      read_function(words, at, m);
      move.functions.push_back(m);
    } else if (name == "R" || name == "RL" || name == "RR") {
      read_side(name, words, at, move);
    } else if (name[0] == 'F') {
      if (move.feed_word != FeedWord::None) words.refuse(at, "F once in a block");
      const FeedValue feed = feed_value(name.substr(1), words, at);
      move.feed_word = feed.word;
      move.feed = feed.value;
    } else if (read_axis(name, words, at, move)) {
      if (!move.functions.empty())
        words.refuse(at, "axis words before the M functions of a block: those behind are theirs");
    } else if (!read_polar(name, words, at, move)) {
      refuse_if_named(name, words.cause(at));
      run_.unknown(words.cause(at), "a word of Klartext");
      if (words.has_value()) words.value();
    }
  }
  return move;
}

/// FMAX holds for its block; every other F until the next.
void Machine::set_feed(const Move& move) {
  const double f_unit = canon_.inch() ? 0.1 * units::inch : 1.0;  // in inches F counts tenths
  switch (move.feed_word) {
    case FeedWord::Number:
    case FeedWord::OfTool:
      feed_per_turn_ = per_turn_;
      feed_ = Feed{move.feed, per_turn_ ? 1.0 : f_unit};
      break;
    case FeedWord::PerTurn:
      feed_per_turn_ = true;
      feed_ = Feed{move.feed, unit()};
      break;
    default:
      break;
  }
  const FeedMode mode = feed_per_turn_ ? FeedMode::PerRevolution : FeedMode::PerMinute;
  if (mode != canon_.feed_mode() && contour_.beside())
    refuse(move.cause, "R0 before the feed counts otherwise, per minute or per turn");
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed_);
}

void Machine::set_side(const Move& move) {
  if (!move.side) return;
  if (*move.side == '0') return contour_.set_side({}, 0.0, move.side_cause);
  if (plane_) refuse(move.side_cause, "RL and RR outside of tilted planes");
  if (canon_.tip_mode()) refuse(move.side_cause, "M129 before RL and RR");
  working_plane(move.side_cause);
  const auto radius = radius_.find(tool_);
  if (radius == radius_.end())
    refuse(move.side_cause, "a tool whose radius is known",
           tool_ < 0 ? "none" : fmt::format("tool {}", tool_));
  if (move.keyword != "L" && move.keyword != "LP")
    if (!contour_.beside()) refuse(move.side_cause, "L before RL and RR");
  contour_.set_side(*move.side == 'L', radius->second + delta_radius_, move.side_cause);
}

}  // namespace abbe::sim::dialects::heidenhain
