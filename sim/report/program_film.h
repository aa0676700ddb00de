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

/// Which moments of a program a film shows.
namespace abbe::sim {

/// Lines of a program, both ends with them.
struct LineRange {
  int first = 1, last = 1;
};

/// A part of a program in time, s.
struct FilmInterval {
  double begin_s = 0.0, end_s = 0.0;
};

/// From the beginning of the first block on these lines of the program itself, not of its
/// subprograms, to the end of the last one; without lines all of it. None where there is no block.
std::optional<FilmInterval> interval_of_lines(const program::Path& path,
                                              const std::optional<LineRange>& lines);

struct FilmPlan {
  FilmInterval stretch;
  std::vector<double> time_s;  ///< (frames) of the program, rising evenly; the last is the end
  double fps = 25.0;
};

/// round(seconds * fps) frames, at least one, spread evenly from the beginning to the end.
FilmPlan film_plan(const FilmInterval& stretch, double seconds, double fps);

/// How many times faster than the machine the film runs; 0 for a stretch that takes no time.
double speed_factor(const FilmPlan& plan);

/// "12.3 × faster than real time"
std::string speed_text(const FilmPlan& plan);

/// A program as it was cut, to be filmed; what it refers to outlives the film.
struct FilmSource {
  const Job& job;
  const Commands& commands;
  const Process& process;  ///< of [cutting], with its stock; else empty
  /// When vertices of the design were cut; null with [cutting].
  const cutting::Surface* surface = nullptr;
};

struct FilmOptions {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  /// Of the errors of the tool and its path; 1: the path is not drawn; none: a round one, by which
  /// the largest is about a twentieth of the part.
  std::optional<double> magnification = 1.0;
};

/// The text of a program line by line, to be looked up.
class ProgramText {
 public:
  /// Of the program that commands run; without words where its files cannot be read.
  ProgramText(const Job& job, const Commands& commands);

  /// The words of a block on one line, control characters spelt out; empty where they are not
  /// known.
  std::string of(const program::Block& block) const;

 private:
  std::vector<std::vector<std::string>> files_;  ///< as `Block::file` counts them
};

/// The film of a program: the machine with its bodies where the actual axes are, errors and forces
/// included, its tool where its errors, magnified, take it, and the stock that is left, or on the
/// design what is cut. Spindles are drawn at rest: between two frames they turn many times.
class ProgramFilm {
 public:
  /// @throws BadInput as `bodies_of`, and where a table of the errors is left
  ProgramFilm(const FilmSource& cut, FilmPlan plan, const FilmOptions& options = {});

  const render::FilmSetting& setting() const { return setting_; }
  std::size_t frames() const { return plan_.time_s.size(); }

  /// One frame; with [cutting] they must be asked for in rising order.
  render::FilmState state(std::size_t frame);
  /// mm^3, of the stock as it is now; 0 without [cutting].
  double volume() const { return stock_ ? stock_->volume() : 0.0; }

 private:
  /// What a frame shows: a sample of a part of the job.
  struct Moment {
    std::size_t part = 0, sample = 0;
    kinematics::Pose T_wt;  ///< where the tool is, the workpiece spindle turned back
    kinematics::Pose T_wt_nominal;
    double error = 0.0;  ///< mm, of the tip
    std::vector<kinematics::Pose> carriers_b;
  };
  /// What moves a body of the setting.
  struct Actor {
    int frame = 0;                         ///< its carrier
    std::optional<std::size_t> part = {};  ///< to whose tool it belongs; none: to the machine
    kinematics::Pose T = kinematics::Pose::Identity();  ///< in the frame of its carrier
    bool cuts = false;                                  ///< the part of a tool that does
  };
  /// The path of the tip at feed, in passes.
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
