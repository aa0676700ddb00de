#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/cut/job.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"

/// What a scene asks of the computer in time, for the time left: stages as `prepare`, the cuts and
/// the writing of results report them.
namespace abbe::sim {

/// What the time of the stages depends on.
struct WorkSize {
  double vertices = 0.0;
  double blocks = 0.0;
  double samples = 0.0;
  bool stock = false;       ///< the blank is cut as well
  bool generated = false;   ///< the program is written first
  bool collisions = false;  ///< bodies are followed as well
  double in_windows = 0.0;  ///< samples of which so many are held at once; 0: all
};
/// Before a scene is prepared, roughly.
WorkSize expected_size(const Scene& scene);
WorkSize size_of(const Job& job);

/// @param part  to which the stages belong
std::vector<Stage> scene_preparation_stages(const std::string& part, const WorkSize& size);
/// Of choosing the places at which the part is judged.
std::vector<Stage> sampling_stages(const std::string& part, const WorkSize& size,
                                   const Scene& scene);
/// The size once they are chosen, roughly.
WorkSize size_after_sampling(WorkSize size, const Scene& scene);
/// Of the uncompensated case.
std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size);
/// Of a case, with what its compensator learns and corrects; without one as programmed.
std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                              const std::optional<CaseDescription>& compensator);
std::vector<Stage> error_free_stages(const std::string& part, const WorkSize& size);
/// Of the commands of a compensator alone.
std::vector<Stage> command_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                                  const CaseDescription& compensator);
/// Of the files of a case.
std::vector<Stage> file_stages(const std::string& part, const WorkSize& size);
/// Of what the words of a rewritten program change.
std::vector<Stage> rewriting_stages(const std::string& part, const WorkSize& size);
/// Of looking for collisions.
std::vector<Stage> collision_stages(const std::string& part, const WorkSize& size);
/// Of a film of so many frames of so many pixels, and of one file of them.
std::vector<Stage> film_stages(const std::string& part, const WorkSize& size, double frames,
                               double pixels);
/// Of one picture of so many maps.
std::vector<Stage> comparison_stages(const std::string& part, const WorkSize& size, double maps);

double seconds_of(const std::vector<Stage>& stages);
/// Both, the second after the first.
std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second);

// What `run` and `compare` take of the memory at their peak, known before anything is cut.

/// The cases that are cut.
struct CaseRequest {
  double kept = 1.0;         ///< so many maps stay until the last is written
  bool compensated = false;  ///< one has a compensator
  bool rewritten = false;    ///< whose commands have samples of their own
  bool pictures = true;      ///< they are drawn
  bool compared = false;     ///< and all of them in one picture
  bool tracked = false;      ///< the tracks of their tools are kept
  int at_once = 1;           ///< so many of them are cut, and then drawn, at a time
};
CaseRequest run_case_request(const std::optional<CaseDescription>& compensator);
CaseRequest compare_case_request(const std::vector<Scene>& scenes);

/// Bytes. Within 30 % of the scenes it was measured on; dexels of a fine stock come on top.
/// @param jobs  all are held while the cases of one are cut; vertices as they are judged
double peak_memory(const std::vector<WorkSize>& jobs, const CaseRequest& asked);

/// Samples of its program that a job may hold at its peak within `memory_bytes`; 0 where they are
/// fewer than is worth it, a hundred thousand.
std::size_t max_samples_in_memory(WorkSize job, const CaseRequest& asked);

/// How many cases to cut and draw at once: one a thread, as long as that leaves a third of
/// `memory_bytes`.
int cases_at_once(const std::vector<WorkSize>& jobs, CaseRequest asked);

/// @param whole  what asks for samples of the whole program, in a word; empty for nothing
/// @throws BadInput naming the keys and the figures if that is more than `memory_bytes`
void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CaseRequest& asked,
                  const std::string& whole = {});

/// One line for a person, empty below 2 GB.
std::string memory_remark(const std::vector<WorkSize>& jobs, const CaseRequest& asked);

}  // namespace abbe::sim
