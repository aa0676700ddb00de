#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_machine.h"
#include "sim/dialects/heidenhain_words.h"

/// M words: what Machine does with them.
namespace abbe::sim::dialects::heidenhain {

using program::Feed;

namespace {

/// M words whose effect begins at the end of their block.
bool acts_behind(int number) {
  static constexpr int all[] = {0, 1, 2, 5, 9, 30, 89, 99, 127, 129};
  return std::find(std::begin(all), std::end(all), number) != std::end(all);
}

/// Words behind M functions without effect are their own: M118 X1 Y1 moves nothing, the F of M103 is
/// a percentage.
void pass_own_words(int number, Words& words) {
  const auto pass = [&](auto is_own) {
    Words ahead = words;
    const std::string name = ahead.name();
    if (!is_own(name) || !ahead.has_value()) return false;
    ahead.value();
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  const auto is_axis = [](const std::string& name) {
    return name.size() == 1 && std::string_view("XYZABCUVW").find(name[0]) != std::string_view::npos;
  };
  switch (number) {
    case 101:
      pass([](const std::string& name) { return name == "BT"; });
      break;
    case 103:
      pass([](const std::string& name) { return name == "F"; });
      break;
    case 118:
      while (pass(is_axis)) {
      }
      if (Words ahead = words; ahead.name().starts_with('F'))
        words.refuse(words.cursor.at, "F before M118: what stands behind it is its own");
      break;
    case 120:
      pass([](const std::string& name) { return name == "LA"; });
      break;
    default:
      break;
  }
}

}  // namespace

/// Behind M: its number, and what belongs to it.
void Machine::read_function(Words& words, std::size_t from, M& m) {
  m.number = words.whole(999);
  m.cause = words.cause(from);
  const std::string name = fmt::format("M{}", m.number);
  refuse_if_named(name, m.cause);
  if (find_word(heidenhain_words(), name) == nullptr) run_.unknown(m.cause, "an M word of a TNC");
  const auto next_is = [&](std::string_view wanted) {
    Words ahead = words;
    if (ahead.name() != wanted) return false;
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  pass_own_words(m.number, words);
  if (m.number == 140) {
    words.cursor.skip_blanks();
    if (next_is("MBMAX"))
      m.mb_max = true;
    else if (!next_is("MB"))
      words.refuse(words.cursor.at, "MB after M140");
    else if (next_is("MAX"))
      m.mb_max = true;
    else
      m.mb = words.value() * unit();
  }
  if (m.number == 140 || m.number == 128) {
    words.cursor.skip_blanks();
    const std::size_t at = words.cursor.at;
    Words ahead = words;
    if (const std::string feed = ahead.name(); feed.starts_with('F')) {
      words.cursor.at = ahead.cursor.at;
      const FeedValue value = feed_value(feed.substr(1), words, at);
      m.rapid = value.word == FeedWord::Rapid;
      if (!m.rapid) m.feed = value.value;
      if (value.word == FeedWord::PerTurn)
        words.refuse(at, "a feed per minute after M140 and M128");
    }
  }
  if (m.number == 128 && m.feed)
    run_.warn_once("F beside M128 limits the feed of compensating moves: it has no effect here");
  if (m.number == 94 && !words.at_end()) {
    Words ahead = words;
    const std::string axis = ahead.name();
    if (axis.size() == 1 && !ahead.has_value()) {
      m.axis = axis.front();
      words.cursor.at = ahead.cursor.at;
    }
  }
}

void Machine::functions_before(Move& move) {
  for (const M& m : move.functions)
    if (!acts_behind(m.number)) start_function(m, move);
}

void Machine::start_function(const M& m, Move& move) {
  const auto spindle = [&](int direction) {
    contour_.after([this, direction] { canon_.turn_spindle(direction); });
  };
  const auto aside = [&](const char* text) {
    contour_.after([this, text] { canon_.aside(text); });
  };
  switch (m.number) {
    case 3:
    case 4:
      return spindle(m.number == 3 ? 1 : -1);
    case 7:
      return aside("M7");
    case 8:
      return aside("M8");
    case 13:
    case 14:
      spindle(m.number == 13 ? 1 : -1);
      return aside("M8");
    case 91:
      move.machine = true;
      return;
    case 94:
      return reduce_turns(m);
    case 126:
      short_way_ = true;
      return;
    case 128:
      return set_tcpm(true, m.cause);
    case 136:
      if (canon_.inch()) refuse(m.cause, "M136 in a program of MM");
      per_turn_ = feed_per_turn_ = true;
      feed_.reset();
      return;
    case 137:
      if (per_turn_) feed_.reset();
      per_turn_ = feed_per_turn_ = false;
      return;
    case 140:
      return retract(m, move);
    default:
      return;  // without effect, as the table of words says
  }
}

void Machine::functions_behind(const Move& move) {
  bool calls = modal_cycle_ && std::any_of(move.axes.begin(), move.axes.end(),
                                           [](const auto& axis) { return axis.has_value(); });
  Cause cause = move.cause;
  for (const M& m : move.functions) {
    if (m.number == 99) {
      calls = true;
      modal_cycle_ = false;
      cause = m.cause;
    } else if (m.number == 89) {
      calls = modal_cycle_ = true;
      cause = m.cause;
    } else if (acts_behind(m.number)) {
      end_function(m);
    }
  }
  if (calls) run_cycle(0.0, cause);
}

void Machine::end_function(const M& m) {
  switch (m.number) {
    case 0:
    case 1:
    case 9: {
      const char* text = m.number == 0 ? "M0" : m.number == 1 ? "M1" : "M9";
      return contour_.after([this, text] { canon_.aside(text); });
    }
    case 5:
      return contour_.after([this] { canon_.turn_spindle(0); });
    case 127:
      short_way_ = false;
      return;
    case 129:
      return set_tcpm(false, m.cause);
    case 2:
    case 30:
      contour_.finish();
      ended_ = true;
      return;
    default:
      return;
  }
}

/// M94: whole turns are taken off what the control counts.
void Machine::reduce_turns(const M& m) {
  if (contour_.beside()) refuse(m.cause, "R0 before M94");
  const AxisVector p = canon_.programmed();
  const char only = m.axis;
  if (only != '\0') joint_of(only, m.cause);
  for (const char letter : {'A', 'B', 'C'})
    if (const int j = canon_.joint_of(letter);
        j >= 0 && !canon_.is_linear(j) && (only == '\0' || only == letter))
      turns_[j] += 2 * pi * std::floor(p[j] / (2 * pi) + 1e-9);
  apply_frame(m.cause);
}

void Machine::retract(const M& m, const Move& move) {
  if (contour_.beside()) refuse(m.cause, "R0 before M140");
  for (const auto& axis : move.axes)
    if (axis)
      refuse(m.cause, "M140 in a block without axes: which of the two is first is not known");
  const auto before = canon_.feed();
  if (m.feed) {
    if (!(*m.feed > 0)) refuse(m.cause, "a feed above zero");
    canon_.set_feed(Feed{*m.feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  retract_by(m.mb.value_or(0.0), m.mb_max, !m.feed, m.cause);
  canon_.set_feed(before);
}

}  // namespace abbe::sim::dialects::heidenhain
