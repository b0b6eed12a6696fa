#pragma once

#include "palpate/testing/support.hpp"

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::testing {

using Words = std::vector<std::string>;

/// The sample heart that ships with the program.
std::string sample();
ProgramResult cli(const Words& arguments);
/// With variables of the environment, "NAME=value".
ProgramResult cli_with(const Words& environment, const Words& arguments);
/// Runs with --json, checks exit 0 and gives the object.
nlohmann::json cli_json(Words arguments);
/// Without what depends on the machine's speed.
nlohmann::json without_times(nlohmann::json object);
/// Arguments after "simulate": a block of the sample that a run is done with at once.
Words small_block();
void write_file(const std::filesystem::path& path, const std::string& text);
/// A move of `drag_mm` along z in `seconds`, seen from the left by parallel rays,
/// begun at the middle of the sample.
std::string pull_gesture(double drag_mm, double seconds, double radius_mm);
/// Keys of an object, in order.
Words keys_of(const nlohmann::json& object);
bool opencl_present();

}  // namespace palpate::testing
