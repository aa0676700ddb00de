#pragma once

#include "sim/cut/cut.h"
#include "sim/loop/learn.h"

/// The loop around a job: its control sees it, its workshop does what a compensator asks for.
namespace abbe::sim {

/// What a compensator may know of a job, which must outlive it.
Seen seen_of(const Job& job);

/// What a compensator can have done with a job, which must outlive it.
Workshop workshop_of(const Job& job);

/// What the control can read while a program runs, the thermal history before it: encoders,
/// temperatures, current, dynamometer, with their noise. What happens inside the machine is left
/// out.
compensation::ControlLog control_log(const Job& job, const Commands& commands,
                                     const Process& process);

/// What corrects the program of a case.
/// @throws as `learnt` of what is seen
Learnt learnt(const Job& job, const CaseDescription& compensator, const Progress& progress = {});

/// A compensator of the scene acting on the commands.
/// @throws as `learnt`
Commands compensate(const Job& job, const CaseDescription& compensator,
                    const Progress& progress = {});

/// What of a case needs a program that is sampled as a whole, in a word; empty where it can be run
/// in windows.
std::string what_needs_whole(const Scene& scene, const std::optional<CaseDescription>& compensator);

/// The program on the wrong machine, with a compensator if there is one.
/// @throws as `compensate`, and as `cut` of commands
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress = {}, Keep keep = Keep::Map);

}  // namespace abbe::sim
