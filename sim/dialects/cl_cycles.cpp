#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/dialects/cl_machine.h"

namespace abbe::sim::dialects::cl {

using Eigen::Vector3d;
using program::Feed;
using program::FeedMode;

namespace {

/// What the words behind CYCLE/DRILL said so far, mm from the point along the tool axis.
struct HoleWords {
  std::optional<double> bottom, clear, back;
};

}  // namespace

/// CYCLE/DRILL: number pairs in any order.
Machine::Hole Machine::hole_of(const Statement& s) {
  HoleWords words;
  Hole hole;
  const auto one = [&](std::optional<double>& into, const Item& word, double value) {
    if (into) refuse(word, "a distance once", std::string(word.text) + " besides");
    into = value;
  };
  for (std::size_t i = 1; i < s.items.size(); ++i) {
    const Item& word = s.items[i];
    if (word.number && i == 1) {
      words.bottom = -*word.number * unit();
      continue;
    }
    if (word.number) refuse(word, "a word before the number");
    const bool feeds = word.is("MMPM") || word.is("IPM") || word.is("PERMIN") || word.is("MMPR") ||
                       word.is("IPR") || word.is("PERREV");
    const bool known = feeds || word.is("DEPTH") || word.is("FEDTO") || word.is("CLEAR") ||
                       word.is("RAPTO") || word.is("RTRCTO") || word.is("RETURN") ||
                       word.is("DWELL");
    if (!known) {
      unknown(s, word, "DEPTH, FEDTO, CLEAR, RAPTO, RTRCTO, RETURN, DWELL or a unit of feed");
      while (i + 1 < s.items.size() && s.items[i + 1].number) ++i;
      continue;
    }
    if (i + 1 < s.items.size() && !s.items[i + 1].number)
      refuse(s.items[i + 1], fmt::format("a number behind {}: levels that a control chooses are "
                                         "not known here",
                                         word.text));
    const double value = number(s, ++i, "a number");
    if (feeds) {
      if (!(value > 0)) refuse(s.items[i], "a feed above zero");
      const bool inches = word.is("IPM") || word.is("IPR");
      const bool own_unit = word.is("PERMIN") || word.is("PERREV");
      hole.feed = Feed{value, own_unit ? unit() : inches ? units::inch : 1.0};
      if (word.is("MMPR") || word.is("IPR") || word.is("PERREV"))
        hole.mode = FeedMode::PerRevolution;
    } else if (word.is("DEPTH") || word.is("FEDTO")) {
      one(words.bottom, word, (word.is("DEPTH") ? -value : value) * unit());
    } else if (word.is("CLEAR") || word.is("RAPTO")) {
      one(words.clear, word, value * unit());
    } else if (word.is("DWELL")) {
      hole.dwell_s = value;
    } else {
      one(words.back, word, value * unit());
    }
  }
  if (!words.bottom) refuse(s.cause, "DEPTH or FEDTO and a distance behind CYCLE/DRILL", "none");
  if (!words.clear) refuse(s.cause, "CLEAR or RAPTO and a distance behind CYCLE/DRILL", "none");
  hole.depth = -*words.bottom;
  hole.clear = *words.clear;
  hole.back = words.back.value_or(hole.clear);
  if (!(hole.clear > -hole.depth) || hole.back < hole.clear)
    refuse(s.cause, "the bottom below the clearance, and that not above the return",
           fmt::format("{:.6g}, {:.6g} and {:.6g} mm above the point", -hole.depth, hole.clear,
                       hole.back));
  return hole;
}

void Machine::cycle(const Statement& s) {
  circle_.reset();
  if (s.items.empty()) refuse(s.cause, "DRILL or OFF behind CYCLE/");
  if (s.items.front().is("OFF")) {
    hole_.reset();
    return;
  }
  if (!s.items.front().is("DRILL"))
    refuse(s.items.front(), "CYCLE/DRILL, or the moves themselves: other cycles are not expanded");
  hole_ = hole_of(s);
}

void Machine::go(const Location& to, const Cause& cause, bool rapid) {
  straight(to, cause, true, rapid);
}

/// Over the hole at the level at which the tool is, or up to the clearance first; down at feed,
/// and back at rapid.
void Machine::hole(const Location& at, const Cause& cause) {
  const Hole& hole = *hole_;
  be_ready(cause);
  const auto above = [&](double height) {
    return Location{at.tip + at.direction * height, at.direction};
  };
  if (at.direction == turned_to_) {
    const Location now = here();
    const double level = at.direction.dot(now.tip - at.tip);
    if (level >= hole.clear)
      go(above(level), cause, true);
    else
      go({now.tip + at.direction * (hole.clear - level), at.direction}, cause, true);
  }
  go(above(hole.clear), cause, true);
  const auto feed = canon_.feed();
  const FeedMode mode = canon_.feed_mode();
  if (hole.feed) {
    canon_.set_feed_mode(hole.mode);
    canon_.set_feed(hole.feed);
  }
  go(above(-hole.depth), cause, false);
  canon_.dwell(hole.dwell_s, cause);
  go(above(hole.back), cause, true);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

}  // namespace abbe::sim::dialects::cl
