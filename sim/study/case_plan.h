#pragma once

#include <cstdint>
#include <vector>

#include "sim/study/farm.h"
#include "sim/study/influence.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Consecutive cases of one analysis.
struct Block {
  enum class Kind { Base, OneAtATime, MonteCarlo, Sobol, Sweep, Proof } kind = Kind::Base;
  std::uint64_t first = 0;
  std::uint64_t count = 0;
  int sweep = 0;      ///< index of the sweep, for kind Sweep
  bool full = false;  ///< true if the cases are cut in full, not estimated from influence maps
};
/// Returns the name of an analysis in tables, such as "monte_carlo".
const char* name_of(Block::Kind kind);

/// The cases of a study in order: the base machine; one at a time (input by input, minus then
/// plus); Monte-Carlo; Sobol (base point by base point: A, B, A with column i of B); sweeps; proofs
/// (the first Monte-Carlo cases again, cut in full).
struct Plan {
  std::vector<Block> blocks;
  std::uint64_t cases = 0;
};
/// Returns the plan of a study. Its order must never change: it numbers the cases in journals.
Plan make_plan(const Study& study);

/// Returns the block that contains a case.
/// @param index  below plan.cases
const Block& find_block(const Plan& plan, std::uint64_t index);

/// Returns the values of the inputs at points of the unit cube, correlated by a study's copula.
/// @param u  (inputs x cases)
Eigen::MatrixXd draw_inputs(const Study& study, const Eigen::MatrixXd& u);

/// Returns the inputs of the cases first .. last - 1. (inputs x cases)
Eigen::MatrixXd case_inputs(const Study& study, const Plan& plan, std::uint64_t first,
                            std::uint64_t last);

/// Divides the plan into batches that are always computed whole: 72 cases from influence maps, or
/// one case that is cut.
std::vector<Batch> make_batches(const Plan& plan);

/// A study with everything that its cases need. Immutable after its preparation.
struct PreparedStudy {
  Study study;
  Plan plan;
  std::vector<PreparedConfiguration> configurations;
  std::vector<InfluenceMap> influences;  ///< (configurations), empty with the full engine
};

/// Prepares every configuration and, unless every case is cut, its influence map.
/// @throws BadScene, BadInput
PreparedStudy prepare_study(const Study& study, const Progress& progress = {});

/// Returns the function that computes a batch. It is thread-safe; `prepared` must outlive it.
/// The rows of a batch do not depend on the process that computes it. A machine that cannot cut the
/// program gives a row with the reason.
ComputeBatch batch_computation(const PreparedStudy& prepared);

/// Returns the column of a response in the responses of a row: configuration by configuration,
/// response by response.
std::size_t response_column(const Study& study, std::size_t configuration, std::size_t response);

}  // namespace abbe::sim::study
