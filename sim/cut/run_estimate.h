#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/cut/job.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"

/// Estimates of the time and memory of a run: the stages of `prepare`, of the cuts and of writing
/// the results, and the peak memory.
namespace abbe::sim {

/// Sizes on which the time of the stages depends.
struct WorkSize {
  double vertices = 0.0;
  double blocks = 0.0;
  double samples = 0.0;
  bool has_stock = false;       ///< true if the stock is simulated
  bool is_generated = false;    ///< true if the program is generated
  bool has_collisions = false;  ///< true if collisions are searched
  double window_samples = 0.0;  ///< number of samples held at once, of a job in windows; 0: all
  double window_steps = 0.0;    ///< number of steps of the cutting process of a job in windows
};
/// Returns a rough size of a scene before it is prepared.
WorkSize expected_size(const Scene& scene);
/// Returns the size of a prepared job.
WorkSize work_size(const Job& job);

/// Returns the stages of preparing a scene.
/// @param part  name in front of the stages
std::vector<Stage> scene_preparation_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of choosing the vertices at which the part is judged.
std::vector<Stage> sampling_stages(const std::string& part, const WorkSize& size,
                                   const Scene& scene);
/// Returns the rough size after the choice of these vertices.
WorkSize size_after_sampling(WorkSize size, const Scene& scene);
/// Returns the stages of the uncompensated case.
std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of a case, including the learning and the correction of its compensator;
/// without a compensator, those of the uncompensated case.
std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                              const std::optional<CaseDescription>& compensator);
/// Returns the stages of the error-free case.
std::vector<Stage> error_free_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of the commands of a compensator alone.
std::vector<Stage> command_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                                  const CaseDescription& compensator);
/// Returns the stages of writing the files of a case.
std::vector<Stage> file_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of rewriting a program with its rounded numbers.
std::vector<Stage> rewriting_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of a collision search.
std::vector<Stage> collision_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of computing and encoding a film.
/// @param frames  number of frames
/// @param pixels  number of pixels per frame
std::vector<Stage> film_stages(const std::string& part, const WorkSize& size, double frames,
                               double pixels);
/// Returns the stages of a picture that compares a number of maps.
std::vector<Stage> comparison_stages(const std::string& part, const WorkSize& size, double maps);

/// Returns the sum of the seconds of stages.
double total_seconds(const std::vector<Stage>& stages);
/// Returns the stages of both, one after the other.
std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second);

// The peak memory of `run` and `compare` is estimated before anything is cut.

/// The cases to be cut, for the estimate of memory.
struct CaseRequest {
  double kept_maps = 1.0;               ///< number of maps kept until the last is written
  bool has_compensator = false;         ///< true if a case has a compensator
  bool has_rewritten_commands = false;  ///< true if a case has commands with samples of their own
  bool draws_pictures = true;           ///< true if pictures are drawn
  bool has_comparison_picture = false;  ///< true if one picture shows all cases
  bool keeps_tracks = false;            ///< true if the tracks of the tools are kept
  int max_parallel = 1;                 ///< number of cases cut, and then drawn, at the same time
};
/// Returns the request of `run`: one case.
CaseRequest run_case_request(const std::optional<CaseDescription>& compensator);
/// Returns the request of `compare`: all cases of all scenes.
CaseRequest compare_case_request(const std::vector<Scene>& scenes);

/// Returns the estimated peak memory, bytes, within 30 % on the scenes of its calibration. Dexels
/// of a fine stock are not included.
/// @param jobs  sizes after the choice of the judged vertices; all are in memory while the cases of
///        one are cut
double peak_memory(const std::vector<WorkSize>& jobs, const CaseRequest& request);

/// Returns the number of samples of a job with which its peak is within `memory_bytes`; 0 if it is
/// below a hundred thousand, since windows then cost more than they save.
/// @param jobs  number of jobs of this size that are in memory together
std::size_t max_samples_in_memory(WorkSize job, const CaseRequest& request, std::size_t jobs = 1);

/// Returns the number of cases to cut and draw at the same time: one for each thread, as long as a
/// third of `memory_bytes` is free.
int cases_at_once(const std::vector<WorkSize>& jobs, CaseRequest request);

/// Throws BadInput naming the keys and the figures if the estimate exceeds `memory_bytes`.
/// @param windows_obstacle  what prevents windows, for the message; empty: nothing does
void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CaseRequest& request,
                  const std::string& windows_obstacle = {});

/// Returns a line that tells the user about the memory; empty below 2 GB.
std::string memory_remark(const std::vector<WorkSize>& jobs, const CaseRequest& request);

}  // namespace abbe::sim
