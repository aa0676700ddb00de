#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/cut/job.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"

/// Estimates of time and memory of a run: the stages that `prepare`, the cuts and the writing of
/// results report, and the peak of the memory.
namespace abbe::sim {

/// Sizes on which the time of the stages depends.
struct WorkSize {
  double vertices = 0.0;
  double blocks = 0.0;
  double samples = 0.0;
  bool stock = false;           ///< the stock is simulated
  bool generated = false;       ///< the program is generated
  bool collisions = false;      ///< collisions are searched
  double window_samples = 0.0;  ///< number of samples held at once, of a job in windows; 0: all
};
/// Returns a rough size of a scene before it is prepared.
WorkSize expected_size(const Scene& scene);
/// Returns the size of a prepared job.
WorkSize size_of(const Job& job);

/// Returns the stages of preparing a scene.
/// @param part  name in front of the stages
std::vector<Stage> scene_preparation_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of choosing the vertices at which the part is judged.
std::vector<Stage> sampling_stages(const std::string& part, const WorkSize& size,
                                   const Scene& scene);
/// Returns the rough size after these vertices are chosen.
WorkSize size_after_sampling(WorkSize size, const Scene& scene);
/// Returns the stages of the uncompensated case.
std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size);
/// Returns the stages of a case, with the learning and correcting of its compensator; without one
/// as programmed.
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
/// Returns the stages of a film with so many frames of so many pixels, and of writing one file of
/// them.
std::vector<Stage> film_stages(const std::string& part, const WorkSize& size, double frames,
                               double pixels);
/// Returns the stages of one picture of so many maps.
std::vector<Stage> comparison_stages(const std::string& part, const WorkSize& size, double maps);

/// Returns the sum of the seconds of stages.
double seconds_of(const std::vector<Stage>& stages);
/// Returns the stages of both, the second after the first.
std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second);

// Peak memory of `run` and `compare`, known before anything is cut.

/// The cases to be cut, for the estimate of memory.
struct CaseRequest {
  double kept = 1.0;         ///< number of maps held until the last is written
  bool compensated = false;  ///< one case has a compensator
  bool rewritten = false;    ///< one case has commands with samples of their own
  bool pictures = true;      ///< pictures are drawn
  bool compared = false;     ///< all cases are drawn in one picture
  bool tracked = false;      ///< the tracks of the tools are kept
  int at_once = 1;           ///< number of cases cut, and then drawn, at a time
};
/// Returns the request of `run`: one case.
CaseRequest run_case_request(const std::optional<CaseDescription>& compensator);
/// Returns the request of `compare`: all cases of all scenes.
CaseRequest compare_case_request(const std::vector<Scene>& scenes);

/// Returns the estimated peak memory, bytes: within 30 % on the scenes it was measured on. Dexels
/// of a fine stock come on top.
/// @param jobs  all are in memory while the cases of one are cut; vertices as judged
double peak_memory(const std::vector<WorkSize>& jobs, const CaseRequest& asked);

/// Returns the number of samples that a job may hold at its peak within `memory_bytes`; 0 if they
/// are fewer than a hundred thousand, which is not worth it.
std::size_t max_samples_in_memory(WorkSize job, const CaseRequest& asked);

/// Returns the number of cases to cut and draw at once: one per thread, as long as a third of
/// `memory_bytes` remains free.
int cases_at_once(const std::vector<WorkSize>& jobs, CaseRequest asked);

/// Throws BadInput naming the keys and the figures if the estimate exceeds `memory_bytes`.
/// @param whole  what needs the samples of the whole program, for the message; empty if nothing
void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CaseRequest& asked,
                  const std::string& whole = {});

/// Returns one line on the memory for the user; empty below 2 GB.
std::string memory_remark(const std::vector<WorkSize>& jobs, const CaseRequest& asked);

}  // namespace abbe::sim
