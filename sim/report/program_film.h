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

/// Films of a program: the interval and the frames, the machine and the stock in each of them.
namespace abbe::sim {

/// Lines of a program, both ends included.
struct LineRange {
  int first = 1, last = 1;
};

/// A time interval of a program, s.
struct FilmInterval {
  double begin_s = 0.0, end_s = 0.0;
};

/// Returns the interval from the start of the first block on these lines of the program itself, not
/// of its subprograms, to the end of the last one; without lines the whole program. Empty if the
/// lines have no block.
std::optional<FilmInterval> interval_of_lines(const program::Path& path,
                                              const std::optional<LineRange>& lines);

/// Frames of a film.
struct FilmPlan {
  FilmInterval stretch;
  std::vector<double> time_s;  ///< (frames) time in the program, evenly spaced; the last is the end
  double fps = 25.0;
};

/// Returns a plan of round(seconds * fps) frames, at least one, spread evenly from begin to end.
FilmPlan film_plan(const FilmInterval& stretch, double seconds, double fps);

/// Returns the ratio of machine time to film time; 0 for an interval of no duration.
double speed_factor(const FilmPlan& plan);

/// Returns the ratio as text: "12.3 × faster than real time".
std::string speed_text(const FilmPlan& plan);

/// A program as it was cut, to be filmed; everything it refers to must outlive the film.
struct FilmSource {
  const Job& job;
  const Commands& commands;
  const Process& process;  ///< with [cutting] and its stock; else empty
  /// Times at which vertices of the design were cut; null with [cutting].
  const cutting::Surface* surface = nullptr;
};

/// Size and magnification of a film.
struct FilmOptions {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  /// Magnification of the errors of the tool and its path; 1: the path is not drawn; empty: a round
  /// factor that shows the largest error as about a twentieth of the part.
  std::optional<double> magnification = 1.0;
};

/// Source lines of a program, to be looked up.
class ProgramText {
 public:
  /// Reads the program that the commands run; without text if its files cannot be read.
  ProgramText(const Job& job, const Commands& commands);

  /// Returns the text of the line of a block, control characters spelt out; empty if it is not
  /// known.
  std::string of(const program::Block& block) const;

 private:
  std::vector<std::vector<std::string>> files_;  ///< by `Block::file`
};

/// The film of a program: the machine with its bodies at the actual axis positions, errors and
/// forces included, its tool at its magnified deviation, and the remaining stock, or the cut
/// vertices of the design. Spindles are drawn at rest: they turn many times between two frames.
class ProgramFilm {
 public:
  /// @throws BadInput as `job_bodies`, or if an axis leaves a table of the errors
  ProgramFilm(const FilmSource& cut, FilmPlan plan, const FilmOptions& options = {});

  const render::FilmSetting& setting() const { return setting_; }
  std::size_t frames() const { return plan_.time_s.size(); }

  /// Returns one frame; with [cutting] frames must be requested in rising order.
  render::FilmState state(std::size_t frame);
  /// Returns the volume of the stock at the last frame, mm^3; 0 without [cutting].
  double volume() const { return stock_ ? stock_->volume() : 0.0; }

 private:
  /// Sample of the job that a frame shows.
  struct Moment {
    std::size_t part = 0, sample = 0;
    kinematics::Pose T_wt;  ///< pose of the tool, the workpiece spindle turned back
    kinematics::Pose T_wt_nominal;
    double error = 0.0;  ///< mm, of the tip
    std::vector<kinematics::Pose> carriers_b;
  };
  /// Carrier of a body of the setting.
  struct Actor {
    int frame = 0;                         ///< index of its carrier
    std::optional<std::size_t> part = {};  ///< part of the job whose tool it belongs to; empty: the
                                           ///< machine
    kinematics::Pose T = kinematics::Pose::Identity();  ///< in the frame of its carrier
    bool cuts = false;                                  ///< the cutting part of a tool
  };
  /// Path of the tip in feed moves, by passes.
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

  void add_moments();
  void add_body(const cutting::ClosedMesh& mesh, const Actor& actor, const render::FilmBody& look);
  void add_bodies();
  void add_tool(std::size_t part, const std::vector<SolidBody>& solids);
  double part_size() const;
  double largest() const;
  double end_s() const;
  Eigen::Vector3d nominal_tip(std::size_t part, std::size_t sample) const;
  TracedSamples traced_path_samples(std::size_t part);
  void add_trace();
  void add_part();
  void set_views();
  void set_captions();
  kinematics::Pose tool_pose(const Moment& moment) const;
  const kinematics::Pose& workpiece_in_bed(const Moment& moment) const;
  bool is_feeding(const Moment& moment) const;
  std::vector<std::string> values(const Moment& moment, double time_s) const;
  std::vector<render::Wire> paths(double time_s) const;
  void show_part(double time_s, render::FilmState& state);

  FilmSource cut_;
  FilmPlan plan_;
  double magnification_ = 1.0;
  ProgramText words_;
  std::vector<Moment> moments_;
  std::vector<Actor> actors_;
  Trace trace_;
  std::optional<StockReplay> stock_;
  std::shared_ptr<const render::FilmMesh> design_, stock_mesh_;
  std::vector<std::uint8_t> stock_styles_;
  render::FilmSetting setting_;
};

}  // namespace abbe::sim
