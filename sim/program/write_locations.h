#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/chain.h"
#include "sim/program/controlled_axes.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

struct LocationOptions {
  enum class Kind {
    Apt,    ///< statements: UNITS/MM, LOADTL, SPINDL, FEDRAT, RAPID, GOTO, MOVARC, DELAY
    Table,  ///< CSV: x,y,z,i,j,k,feed
  } kind = Kind::Apt;
  double within =
      0.001;  ///< mm, between what is no line (nor, in statements, an arc) and its points
  std::size_t max_bytes = 1'000'000'000;  ///< of all that is written
  int decimals_mm = 7;
  int decimals_vector = 10;
};

/// Writes a path as cutter locations: the tip in the workpiece with the tool axis, for any machine.
/// Rotary axes between two points are those of whoever reads them; read by the same machine, the
/// points are the same to half a decimal.
class LocationWriter {
 public:
  /// @param control  outlives it
  LocationWriter(const kinematics::Chain& control, const LocationOptions& options);

  /// The next blocks. @throws BadInput naming the line where the slides do not reach a tip, or
  /// where the text is longer than allowed
  void add(const Path& piece);
  std::string take();

  std::size_t dwells_left_out() const { return dwells_; }  ///< of a table, as all that follows
  std::size_t words_left_out() const { return words_; }

 private:
  struct Place {
    Eigen::Vector3d tip, axis;
  };
  Place place(const Path& path, const Block& block, double u) const;
  bool is_straight(const Path& path, const Block& block) const;
  void say_asides(const Path& path, std::size_t before, std::size_t& next);
  void spindle(const Block& block);
  void block(const Path& path, const Block& block);
  bool arc(const Path& path, const Block& block);
  void go(const Path& path, const Block& block, double from, double to);
  void point(const Place& at);
  void feed(const std::string& word);
  std::string feed_of(const Path& path, const Block& block, double from, double to, double way);
  bool is_table() const { return options_.kind == LocationOptions::Kind::Table; }

  const kinematics::Chain& control_;
  const LocationOptions options_;
  std::vector<ControlledAxis> axes_;
  int spindle_ = -1;
  std::string text_, feed_, vector_, speed_;
  std::size_t dwells_ = 0, words_ = 0;
};

}  // namespace abbe::sim::program
