#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"
#include "kinematics/chain.h"
#include "sim/program/nc_options.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// How many digits an NC file carries.
struct NcFormat {
  int decimals_mm = 7;
  int decimals_deg = 9;
};

/// G0, G1, or G2 and G3 to a point.
struct NcMove {
  bool rapid = false;
  kinematics::AxisVector to;  ///< (axes) as programmed, mm (inch under G20) and rad; spindles get
                              ///< no word
  double feed = 0.0;          ///< F word as it stands: mm/min, inch/min, deg/min or 1/min; a rapid
                              ///< has none
  struct Round {
    bool clockwise = false;
    std::string letters;     ///< "IJ", "KI" or "JK": the plane in force
    Eigen::Vector2d centre;  ///< mm (inch), from the start, in the order of the letters
  };
  std::optional<Round> round = {};  ///< none: a line
};

/// A line of text as it stands, or a move.
using NcItem = std::variant<std::string, NcMove>;

struct NcWriteOptions {
  NcFormat format;
  bool inverse_time = false;  ///< G93 is in force: F stands in every G1
  int feed_digits = 0;        ///< significant digits of F; 0: as many as hold its bits
};

/// NC text of moves, one line an item; words round to nearest, and those that do not change are
/// left out, but not in the first move after a line of text.
std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options = {});

/// Number as an NC word: no exponent, no trailing zeros, no -0.
std::string nc_number(double value, int decimals);

/// Number rounded to so many significant digits, as an NC word.
std::string nc_significant(double value, int digits);

/// Number with the fewest digits that read back as the same bits, no exponent.
std::string nc_number(double value);

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

  std::size_t omitted_dwells() const { return dwells_; }  ///< of a table, as all that follows
  std::size_t omitted_words() const { return words_; }

 private:
  struct Place {
    Eigen::Vector3d tip, axis;
  };
  Place place(const Path& path, const Block& block, double u) const;
  bool is_straight(const Path& path, const Block& block) const;
  void write_auxiliary_words(const Path& path, std::size_t before, std::size_t& next);
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
