#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/cut/job.h"
#include "sim/files/time_left.h"
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
std::vector<Stage> stages_of_preparing(const std::string& part, const WorkSize& size);
/// Of choosing the places at which the part is judged.
std::vector<Stage> stages_of_sampling(const std::string& part, const WorkSize& size,
                                      const Scene& scene);
/// The size once they are chosen, roughly.
WorkSize once_sampled(WorkSize size, const Scene& scene);
/// Of the uncompensated case.
std::vector<Stage> stages_of_cut(const std::string& part, const WorkSize& size);
/// Of a case, with what its compensator learns and corrects; without one as programmed.
std::vector<Stage> stages_of_cut(const std::string& part, const WorkSize& size, const Scene& scene,
                                 const std::optional<CaseDescription>& compensator);
std::vector<Stage> stages_of_error_free(const std::string& part, const WorkSize& size);
/// Of the commands of a compensator alone.
std::vector<Stage> stages_of_commands(const std::string& part, const WorkSize& size,
                                      const Scene& scene, const CaseDescription& compensator);
/// Of the files of a case.
std::vector<Stage> stages_of_files(const std::string& part, const WorkSize& size);
/// Of what the words of a rewritten program change.
std::vector<Stage> stages_of_words(const std::string& part, const WorkSize& size);
/// Of looking for collisions.
std::vector<Stage> stages_of_collisions(const std::string& part, const WorkSize& size);
/// Of a film of so many frames of so many pixels, and of one file of them.
std::vector<Stage> stages_of_film(const std::string& part, const WorkSize& size, double frames,
                                  double pixels);
/// Of one picture of so many maps.
std::vector<Stage> stages_of_comparison(const std::string& part, const WorkSize& size, double maps);

double seconds_of(const std::vector<Stage>& stages);
/// Both, the second after the first.
std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second);

}  // namespace abbe::sim
