#pragma once

#include "kinematics/inverse_kinematics.h"
#include "tests/test.h"

/// One toolpath as cutter locations and as posts for every control, for tests that hold them
/// against each other.
namespace abbe::sim::dialects::posts {

/// The tip in program coordinates, mm, and the tool axis from the tip to the spindle.
struct PostedPoint {
  Vector3d tip, axis;
  bool rapid = false;
};

/// Points with an upright tool, cut as on three axes, then points with a tool that leans.
struct Toolpath {
  std::vector<PostedPoint> upright, leaning;
  double feed = 800.0;  ///< mm/min
};

/// What one control writes around the coordinates of a point.
struct Post {
  std::string name, file;           ///< as the scene names the dialect
  std::string head, between, end;   ///< lines: of the program, before what leans, behind it
  std::string rapid, line;          ///< what a move begins with
  std::string rapid_end, line_end;  ///< and ends with, {} the feed
  bool signs = false;               ///< numbers always have one
};

inline std::vector<Post> all_posts() {
  return {
      {"linuxcnc", "part.ngc", "G21 G90 G94 G17\nG54\nT1 M6\nS10000 M3\nG43 H1\n", "M428\n",
       "M429\nG49\nM5\nM2\n", "G0", "G1", "", " F{}"},
      {"fanuc", "part.nc", "%\nO1001\nG21 G90 G94 G17 G80 G49\nT1 M6\nG54\nS10000 M3\nG43 H1\n",
       "G43.4 H1\n", "G49\nM5\nM30\n%\n", "G0", "G1", "", " F{}."},
      {"siemens", "part.mpf", "G71 G90 G94 G17\nT1 D1\nG54\nS10000 M3\n", "TRAORI\nORIAXES\n",
       "TRAFOOF\nM5\nM30\n", "G0", "G1", "", " F{}"},
      {"heidenhain", "part.h",
       "BEGIN PGM PART MM\nTOOL CALL 1 Z S10000\nCYCL DEF 247 PRESET SELECT ~\n Q339=+1 "
       ";PRESET\nM3\n",
       "M128\n", "M129\nM5\nM30\nEND PGM PART MM\n", "L", "L", " R0 FMAX", " R0 F{}", true},
  };
}

/// APT, the vectors with all their digits.
inline std::string to_locations(const Toolpath& path) {
  std::string text = "PARTNO DOME\nUNITS/MM\nLOADTL/1\nSPINDL/10000,RPM,CLW\nMULTAX/ON\n";
  text += fmt::format("FEDRAT/{},MMPM\n", path.feed);
  for (const auto* points : {&path.upright, &path.leaning})
    for (const PostedPoint& point : *points)
      text += fmt::format("{}GOTO/{:.9f},{:.9f},{:.9f},{:.16f},{:.16f},{:.16f}\n",
                          point.rapid ? "RAPID\n" : "", point.tip.x(), point.tip.y(), point.tip.z(),
                          point.axis.x(), point.axis.y(), point.axis.z());
  return text + "FINI\n";
}

/// A program of that control; the machine's inverse makes the rotary words.
/// @param zero_w  mm, the zero of the program in the workpiece
inline std::string to_post(const Toolpath& path, const Post& post, const kinematics::Chain& chain,
                           const Vector3d& zero_w) {
  std::string text = post.head;
  const auto word = [&](char letter, double value, int digits) {
    return post.signs ? fmt::format(" {}{:+.{}f}", letter, value, digits)
                      : fmt::format(" {}{:.{}f}", letter, value, digits);
  };
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  const auto put = [&](const PostedPoint& point, bool leans) {
    text += point.rapid ? post.rapid : post.line;
    for (int k = 0; k < 3; ++k) text += word("XYZ"[k], point.tip[k], 9);
    if (leans) q = kinematics::inverse(chain, {zero_w + point.tip, point.axis}, q).branches.at(0);
    for (int j = 0; leans && j < chain.size(); ++j)
      if (chain.joints()[std::size_t(j)].motion == kinematics::Motion::Rotary)
        text += word(chain.joints()[std::size_t(j)].name, q[j] / units::deg, 11);
    text += fmt::format(fmt::runtime(point.rapid ? post.rapid_end : post.line_end), path.feed);
    text += "\n";
  };
  for (const PostedPoint& point : path.upright) put(point, false);
  text += post.between;
  for (const PostedPoint& point : path.leaning) put(point, true);
  return text + post.end;
}

}  // namespace abbe::sim::dialects::posts
