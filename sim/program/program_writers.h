#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"
#include "kinematics/chain.h"
#include "sim/program/nc_options.h"
#include "sim/program/nc_reader.h"
#include "sim/program/path.h"

/// Writers of NC text and of cutter locations.
namespace abbe::sim::program {

/// Numbers of decimals of the words in NC text.
struct NcFormat {
  int decimals_mm = 7;
  int decimals_deg = 9;
};

/// A G0, G1, G2 or G3 move in NC text.
struct NcMove {
  bool rapid = false;
  /// (axes) programmed values, mm (inch under G20) and rad; spindles are not written
  kinematics::AxisVector to;
  /// F as written: mm/min, inch/min, deg/min or 1/min; ignored for a rapid
  double feed = 0.0;
  struct ArcWords {
    bool clockwise = false;
    std::string letters;     ///< "IJ", "KI" or "JK", by the plane in force
    Eigen::Vector2d centre;  ///< mm (inch) relative to the start, in the order of the letters
  };
  std::optional<ArcWords> arc = {};  ///< empty for a straight line
};

/// A line of text that is written unchanged, or a move.
using NcItem = std::variant<std::string, NcMove>;

/// Options of `write_nc`.
struct NcWriteOptions {
  NcFormat format;
  bool inverse_time = false;  ///< G93 is in force, so every G1 has an F
  int feed_digits = 0;        ///< significant digits of F; 0: enough to keep its bits
};

/// Returns NC text with one line for each item. Values are rounded to nearest. A word is omitted if
/// its text is the same as before, except in the first move after a line of text.
std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options = {});

/// Returns the text of a number in an NC word: without exponent, trailing zeros or "-0".
std::string nc_number(double value, int decimals);

/// Returns the text of a number rounded to `digits` significant digits.
std::string nc_significant(double value, int digits);

/// Returns the text of a number without exponent, with the fewest digits that read back as the same
/// bits.
std::string nc_number(double value);

/// Format and tolerance of cutter location output.
struct LocationOptions {
  enum class Kind {
    Apt,    ///< statements: UNITS/MM, LOADTL, SPINDL, FEDRAT, RAPID, GOTO, MOVARC, DELAY
    Table,  ///< CSV: x,y,z,i,j,k,feed
  } kind = Kind::Apt;
  /// mm, tolerance of moves that can only be approximated by points, i.e. moves that are neither
  /// lines nor, in statements, arcs
  double within = 0.001;
  std::size_t max_bytes = 1'000'000'000;  ///< of the whole output
  int decimals_mm = 7;
  int decimals_vector = 10;
};

/// Writes a path as cutter locations, which are independent of the machine: the tip in the
/// workpiece and the tool axis. The file does not state how the rotary axes move between two
/// points. Points read back on the same machine agree to half a unit of the last decimal.
class LocationWriter {
 public:
  /// `control` must outlive the writer.
  LocationWriter(const kinematics::Chain& control, const LocationOptions& options);

  /// Appends the blocks of a path. Throws BadInput with the line at which the slides cannot reach a
  /// tip or the text exceeds `max_bytes`.
  void add(const Path& path);
  /// Moves the text out of the writer.
  std::string take();

  /// Returns the number of dwells omitted because a table cannot hold them.
  std::size_t omitted_dwells() const { return dwells_; }
  /// Returns the number of auxiliary words omitted because a table cannot hold them.
  std::size_t omitted_words() const { return words_; }

 private:
  /// Tip, mm, and tool axis in the workpiece.
  struct TipPose {
    Eigen::Vector3d tip, axis;
  };
  TipPose tip_pose(const Path& path, const Block& block, double u) const;
  bool is_straight(const Path& path, const Block& block) const;
  void write_auxiliary_words(const Path& path, std::size_t block_index, std::size_t& next_word);
  void spindle(const Block& block);
  void block(const Path& path, const Block& block);
  bool arc(const Path& path, const Block& block);
  void write_line(const Path& path, const Block& block, double from, double to);
  void point(const TipPose& pose);
  void feed(const std::string& word);
  std::string feed_word(const Path& path, const Block& block, double from, double to,
                        double tip_travel);
  bool is_table() const { return options_.kind == LocationOptions::Kind::Table; }

  const kinematics::Chain& control_;
  const LocationOptions options_;
  std::vector<ControlledAxis> axes_;
  int spindle_ = -1;
  std::string text_, feed_, vector_, speed_;
  std::size_t dwells_ = 0, words_ = 0;
};

// Position-velocity-time (PVT) programs: reading, writing, and conversion of paths.

/// Reads a position-velocity-time program. It is CSV with a header that names the columns and their
/// units, `time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s`. Rotations may be in deg or
/// rad. Axes without columns stay at the start. Motion between rows is cubic. Lines that start with
/// # are comments. Throws BadInput.
Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options);
/// Reads a PVT program from a file.
Path read_pvt_file(const std::filesystem::path& file, const NcOptions& options);

/// One row of a PVT file.
struct PvtRow {
  double time_s = 0.0;
  kinematics::AxisVector position;  ///< (axes) mm, rad
  kinematics::AxisVector velocity;  ///< (axes) mm/s, rad/s
};

/// Returns the velocity at each row as the slope of the parabola through the positions of the row
/// and its neighbours. Needs at least two rows; ignores their velocities.
std::vector<kinematics::AxisVector> parabola_rates(std::span<const PvtRow> rows);

/// Returns the position on the Hermite cubic between two rows at fraction u of their time.
kinematics::AxisVector hermite_position(const PvtRow& a, const PvtRow& b, double u);

/// Returns rows as PVT text with the fewest digits that read back as the same bits. Rotations are
/// in rad because a conversion to degrees would change the last bit. `columns` holds the indices of
/// the axes that get columns.
std::string write_pvt(std::span<const PvtRow> rows, std::span<const ControlledAxis> axes,
                      std::span<const int> columns);

/// Returns the rows of a path that was read from a PVT file. Throws std::invalid_argument if a
/// block is not a cubic.
std::vector<PvtRow> pvt_rows(const Path& path);

/// Tolerance and limits of a conversion to PVT.
struct PvtConversionOptions {
  double within = 0.001;  ///< mm, tolerance of the path; rotary axes count with `lever`
  double lever = 100.0;   ///< mm
  std::size_t max_rows = 20'000'000;
};

/// Result of a conversion to PVT.
struct PvtConversion {
  std::vector<PvtRow> rows;
  /// mm, largest deviation of the cubics from the path, sampled at three instants of each cubic
  double max_deviation = 0.0;
};

/// Converts a path to positions, velocities and times. Rows are close to both sides of each corner,
/// because a cubic cannot change direction at once, and between corners as dense as curved moves
/// need. The deviation at a corner falls with the time to the adjacent rows. Throws BadInput if
/// there are more rows than allowed or the slides do not reach a tip.
PvtConversion convert_to_pvt(const Path& path, const kinematics::Chain& control,
                             const PvtConversionOptions& options = {});

}  // namespace abbe::sim::program
