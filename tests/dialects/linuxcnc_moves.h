#pragma once

#include "sim/program/path.h"
#include "tests/dialects/linuxcnc_interpreter.h"
#include "tests/test.h"

/// Moves of abbe beside those of LinuxCNC.
namespace abbe::sim::dialects::test {

inline std::vector<Move> moves_of(const program::Path& path) {
  std::vector<Move> moves;
  for (const program::Block& block : path.blocks) {
    if (block.interpolation == program::Interpolation::Dwell) continue;
    Move move;
    for (int k = 0; k < 6; ++k)
      move.end[std::size_t(k)] = block.end[k] / (k < 3 ? 1.0 : units::deg);
    move.kind =
        block.interpolation == program::Interpolation::Rapid ? Move::Kind::Rapid : Move::Kind::Feed;
    if (block.interpolation == program::Interpolation::Arc) {
      const program::Arc& arc = path.arcs[block.shape];
      move.kind = Move::Kind::Arc;
      move.centre = {arc.centre.x(), arc.centre.y()};
      move.sweep = arc.sweep;
    }
    moves.push_back(move);
  }
  return moves;
}

struct Comparison {
  std::string difference;  ///< empty: none
  double off = 0.0;        ///< mm, degrees
  std::size_t moves = 0;
};

inline std::string text_of(const Move& move) {
  static constexpr const char* names[] = {"rapid", "feed", "arc", "spline"};
  std::string text = names[int(move.kind)];
  for (const double one : move.end) text += fmt::format(" {:.6f}", one);
  if (move.kind == Move::Kind::Arc)
    text +=
        fmt::format(" about {:.6f} {:.6f} by {:.6f}", move.centre[0], move.centre[1], move.sweep);
  return text;
}

inline double distance(const Move& a, const Move& b) {
  if (a.kind != b.kind) return 1e9;
  double off = 0.0;
  for (std::size_t k = 0; k < 6; ++k) off = std::max(off, std::abs(a.end[k] - b.end[k]));
  if (a.kind != Move::Kind::Arc) return off;
  // the centre of half a turn by its R is as good as the root of the last digit
  const bool half = std::abs(std::abs(a.sweep) - pi) < 1e-3;
  for (std::size_t k = 0; k < 2; ++k)
    off = std::max(off, (half ? 0.01 : 1.0) * std::abs(a.centre[k] - b.centre[k]));
  return std::abs(a.sweep - b.sweep) > 1e-3 ? 1e9 : off;
}

/// Move by move. Of a spline LinuxCNC prints no points: the chords of ours up to the move that is
/// its next are passed over.
inline Comparison compared(const std::vector<Move>& theirs, const std::vector<Move>& ours,
                           double tolerance) {
  Comparison result;
  result.moves = ours.size();
  std::size_t j = 0;
  for (std::size_t i = 0; i < theirs.size(); ++i) {
    if (theirs[i].kind == Move::Kind::Spline) {
      while (j < ours.size() && ours[j].kind == Move::Kind::Feed &&
             (i + 1 == theirs.size() || distance(theirs[i + 1], ours[j]) > tolerance))
        ++j;
      continue;
    }
    if (j == ours.size()) break;
    double size = 1000.0;
    for (const double one : ours[j].end) size = std::max(size, std::abs(one));
    const double off = distance(theirs[i], ours[j]);
    result.off = std::max(result.off, off);
    if (off > tolerance * size / 1000) {
      result.difference =
          fmt::format("move {}: {} but LinuxCNC {}", j, text_of(ours[j]), text_of(theirs[i]));
      return result;
    }
    ++j;
    if (i + 1 == theirs.size() && j == ours.size()) return result;
  }
  if (j != ours.size() || (!theirs.empty() && theirs.back().kind != Move::Kind::Spline))
    if (theirs.size() != ours.size())
      result.difference = fmt::format("{} moves but LinuxCNC {}", ours.size(), theirs.size());
  return result;
}

}  // namespace abbe::sim::dialects::test
