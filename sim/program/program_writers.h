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

/// Number of decimals in an NC file.
struct NcFormat {
  int decimals_mm = 7;
  int decimals_deg = 9;
};

/// A move in NC text: G0, G1, or G2 and G3 to a point.
struct NcMove {
  bool rapid = false;
  /// (axes) as programmed, mm (inch under G20) and rad; spindles get no word
  kinematics::AxisVector to;
  /// F word as written: mm/min, inch/min, deg/min or 1/min; not used by a rapid.
  double feed = 0.0;
  struct Round {
    bool clockwise = false;
    std::string letters;     ///< "IJ", "KI" or "JK": the plane in force
    Eigen::Vector2d centre;  ///< mm (inch), from the start, in the order of the letters
  };
  std::optional<Round> round = {};  ///< none: a straight line
};

/// A line of text to write unchanged, or a move.
using NcItem = std::variant<std::string, NcMove>;

struct NcWriteOptions {
  NcFormat format;
  bool inverse_time = false;  ///< G93 is in force: every G1 carries F
  int feed_digits = 0;  ///< significant digits of F; 0: as many as are needed to keep its bits
};

/// Returns NC text with one line for each item. Values are rounded to nearest. A word is left out
/// if its text has not changed, except in the first move after a line of text.
std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options = {});

/// Returns a number as an NC word: no exponent, no trailing zeros, no -0.
std::string nc_number(double value, int decimals);

/// Returns a number rounded to `digits` significant digits, as an NC word.
std::string nc_significant(double value, int digits);

/// Returns a number with the fewest digits that read back as the same bits, without exponent.
std::string nc_number(double value);

/// Format and tolerance of cutter location output.
struct LocationOptions {
  enum class Kind {
    Apt,    ///< statements: UNITS/MM, LOADTL, SPINDL, FEDRAT, RAPID, GOTO, MOVARC, DELAY
    Table,  ///< CSV: x,y,z,i,j,k,feed
  } kind = Kind::Apt;
  /// mm, largest deviation of the points from a move that is neither a line nor (in statements) an
  /// arc
  double within = 0.001;
  std::size_t max_bytes = 1'000'000'000;  ///< of the whole output
  int decimals_mm = 7;
  int decimals_vector = 10;
};

/// Writes a path as cutter locations: the tip in the workpiece and the tool axis, for any machine.
/// The rotary axes between two points are left to the reader of the file. Read by the same machine,
/// the points agree to half a unit of the last decimal.
class LocationWriter {
 public:
  /// `control` must outlive the writer.
  LocationWriter(const kinematics::Chain& control, const LocationOptions& options);

  /// Appends blocks. Throws BadInput at the line where the slides do not reach a tip or the text
  /// exceeds `max_bytes`.
  void add(const Path& piece);
  std::string take();

  std::size_t omitted_dwells() const { return dwells_; }  ///< not representable in a table
  /// Returns the number of auxiliary words left out of a table.
  std::size_t omitted_words() const { return words_; }

 private:
  /// Tip and tool axis in the workpiece.
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
