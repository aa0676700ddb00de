#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/film.h"
#include "sim/cut/bodies.h"
#include "sim/cut/cut.h"
#include "sim/cut/job.h"
#include "sim/cut/stock_replay.h"
#include "sim/program/path.h"

/// Films of a program: its time interval and frames, and the machine and the stock in each frame.
namespace abbe::sim {

/// Range of lines of a program, both ends included.
struct LineRange {
  int first = 1, last = 1;
};

/// A time interval of a program, s.
struct FilmInterval {
  double begin_s = 0.0, end_s = 0.0;
};

/// Returns the time interval in which these lines of the main program run, from the start of their
/// first block to the end of their last one, or that of the whole program without `lines`. Empty if
/// the lines have no block.
std::optional<FilmInterval> line_time_interval(const program::Path& path,
                                               const std::optional<LineRange>& lines);

/// Frames of a film.
struct FilmPlan {
  FilmInterval interval;
  std::vector<double> time_s;  ///< (frames) time in the program, evenly spaced; the last is the end
  double fps = 25.0;
};

/// Returns a plan of round(seconds * fps) frames, at least one, evenly spaced over the interval.
FilmPlan film_plan(const FilmInterval& interval, double seconds, double fps);

/// Returns the ratio of machine time to film time; 0 for an empty interval.
double speed_factor(const FilmPlan& plan);

/// Returns the ratio as text: "12.3 × faster than real time".
std::string speed_text(const FilmPlan& plan);

/// A program that was cut and is to be filmed. All objects it refers to must outlive the film.
struct FilmSource {
  const Job& job;
  const Commands& commands;
  const Process& process;  ///< with its stock; empty in a scene without [cutting]
  /// Map with the times at which the vertices of the design were cut; null in a scene with
  /// [cutting].
  const cutting::Surface* surface = nullptr;
};

/// Size and magnification of a film.
struct FilmOptions {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  /// Magnification of the errors of the tool and its path. 1: the path is not drawn. Empty: a round
  /// factor, with which the largest error is about a twentieth of the part.
  std::optional<double> magnification = 1.0;
};

/// Source text of a program.
class ProgramText {
 public:
  /// Reads the program that the commands execute. A file that cannot be read has no text.
  ProgramText(const Job& job, const Commands& commands);

  /// Returns the line of a block with control characters escaped; empty if it is not known.
  std::string line(const program::Block& block) const;

 private:
  std::vector<std::vector<std::string>> files_;  ///< by `Block::file`
};

/// The film of a program. It shows the bodies of the machine at the actual axis positions, with
/// errors and deflection under force, the tool at its magnified deviation, and the remaining stock
/// or the cut vertices of the design. Spindles do not rotate, since they make many turns between
/// two frames.
class ProgramFilm {
 public:
  /// @throws BadInput as `segment_bodies`, or if an axis leaves a table of the errors
  ProgramFilm(const FilmSource& source, FilmPlan plan, const FilmOptions& options = {});

  const render::FilmSettings& setting() const { return setting_; }
  std::size_t frames() const { return plan_.time_s.size(); }

  /// Returns one frame. In a scene with [cutting] frames must be requested in ascending order.
  render::FilmState state(std::size_t frame);
  /// Returns the volume of the stock in the last requested frame, mm^3; 0 without [cutting].
  double volume() const { return stock_ ? stock_->volume() : 0.0; }

 private:
  /// Sample of the job that a frame shows.
  struct FrameSample {
    std::size_t segment = 0, sample = 0;
    kinematics::Pose T_wt;  ///< pose of the tool with the workpiece spindle at rest
    kinematics::Pose T_wt_nominal;
    double error = 0.0;  ///< mm, of the tip
    std::vector<kinematics::Pose> carriers_b;
  };
  /// Attachment of a body of the setting to its carrier.
  struct Attachment {
    int frame = 0;                            ///< index of the carrier
    std::optional<std::size_t> segment = {};  ///< segment of the job whose tool it belongs to;
                                              ///< empty for a body of the machine
    kinematics::Pose T = kinematics::Pose::Identity();  ///< in the frame of the carrier
    bool is_cutting_part = false;                       ///< of a tool
  };
  /// Path of the tip in feed moves, divided into passes.
  struct Trace {
    struct Point {
      double time_s;
      Eigen::Vector3d nominal_w, actual_w;
      int pass;
    };
    std::vector<Point> points;
    int passes = 0;
  };

  struct TracedSamples;

  void add_frame_samples();
  void add_body(const cutting::ClosedMesh& mesh, const Attachment& attachment,
                const render::FilmBody& style);
  void add_bodies();
  void add_tool(std::size_t segment, const std::vector<SolidBody>& solids);
  double part_size() const;
  double max_error() const;
  double end_s() const;
  Eigen::Vector3d nominal_tip(std::size_t segment, std::size_t sample) const;
  TracedSamples traced_path_samples(std::size_t segment);
  void add_trace();
  void add_part();
  void set_views();
  void set_captions();
  kinematics::Pose tool_pose(const FrameSample& frame_sample) const;
  const kinematics::Pose& workpiece_in_bed(const FrameSample& frame_sample) const;
  bool is_feeding(const FrameSample& frame_sample) const;
  std::vector<std::string> values(const FrameSample& frame_sample, double time_s) const;
  std::vector<render::Wire> paths(double time_s) const;
  void show_part(double time_s, render::FilmState& state);

  FilmSource source_;
  FilmPlan plan_;
  double magnification_ = 1.0;
  ProgramText program_text_;
  std::vector<FrameSample> frame_samples_;
  std::vector<Attachment> attachments_;  ///< of the bodies of the setting
  Trace trace_;
  std::optional<StockReplay> stock_;
  std::shared_ptr<const render::FilmMesh> design_, stock_mesh_;
  std::vector<std::uint8_t> stock_styles_;
  render::FilmSettings setting_;
};

}  // namespace abbe::sim
