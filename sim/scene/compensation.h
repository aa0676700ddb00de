#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "errors/compliance.h"
#include "errors/geometric.h"
#include "sim/compensation/channels.h"
#include "sim/compensation/control_files.h"
#include "sim/compensation/machine_belief.h"
#include "sim/compensation/parameter_tables.h"
#include "sim/scene/cases.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// Knowledge given to a compensator; each belief of a case name uses one or several members.
struct BeliefDescription {
  std::optional<errors::GeometricErrors> identified;
  std::optional<compensation::ThermalBelief> thermal;
  std::filesystem::path thermal_file;  ///< file from which `thermal` was read
  struct Force {
    enum class From { Current, Dynamometer, Model } from = From::Model;
    errors::ComplianceErrors compliance;  ///< as believed; unused with From::Current
    std::filesystem::path training;       ///< with From::Current: scene of the part from which the
                                          ///< law is fitted
    std::string instrument;               ///< instrument that measures that part
    double smoothing_s = 0.0;             ///< averaging time of current or dynamometer readings
    int passes = 2;                       ///< training runs, each corrected by the law of the
                                          ///< previous run
  };
  std::optional<Force> force;
  struct Part {
    std::string instrument;  ///< instrument of the scene that measures the part
    int passes = 1;          ///< number of parts cut and measured before the final one
  };
  std::optional<Part> part;
  double scale = 1.0;  ///< factor of identified and thermal; 0 disables both
};

/// Limits and parameters of strategies and channels.
struct CompensationDescription {
  double rotary_bound = 0.1 * 0.017453292519943295;       ///< rad, largest correction of a rotary
                                                          ///< axis
  double word_resolution = 1e-4;                          ///< mm, of a rewritten NC program
  double angle_resolution = 1e-4 * 0.017453292519943295;  ///< rad, the same for rotary words
  double path_tolerance = 0.0;  ///< mm, between the corrected path and that of the rewritten
                                ///< blocks; 0 means the resolution of a word, 1 nm for PVT
  compensation::PositionLoop loop;
  struct PulseInsertion {
    double count = 1e-3;                             ///< mm
    double count_rad = 1e-3 * 0.017453292519943295;  ///< rad
    double cycle_s = 1e-3;
    double pulse_s = 2e-6;
  } pulses;
  compensation::OpenControl open;
  compensation::OriginShift origin;
  struct Table {
    compensation::TableOptions options;
    std::optional<compensation::ControlFormat> format;  ///< the table is exported to and read from
                                                        ///< a file of this control
    std::optional<kinematics::AxisVector> reference;    ///< (joints) positions of the other axes;
                                                        ///< none means the middle of the program
    std::optional<int> tool;  ///< number of the tool whose tip the tables correct; none means the
                              ///< first of the program
  } table;
  compensation::Piezo piezo;
  CaseDescription plug_in;  ///< strategy and channel of plug-ins
};

struct Key;

/// Reads and writes `[belief]`, the knowledge given to compensators.
BeliefDescription read_belief(const Node& table, const MachineDescription& machine,
                              InputErrors& input_errors);
Node::Table belief_to_table(const BeliefDescription& belief, const MachineDescription& machine);
std::vector<Key> belief_keys();

/// Reads and writes `[compensation]`, the strategies and channels with their limits.
CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          InputErrors& input_errors);
Node::Table compensation_to_table(const CompensationDescription& compensation,
                                  const std::vector<kinematics::Joint>& joints);
std::vector<Key> compensation_keys();

}  // namespace abbe::sim
