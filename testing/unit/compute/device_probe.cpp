// Prints how many devices there are, then opens the one that the first
// argument selects; ends with the exit code of the error, if any.
#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"

#include <exception>
#include <iostream>

int main(int argc, char** argv) {
  try {
    const auto devices = palpate::compute::list_devices();
    std::cout << "devices " << devices.size() << "\n";
    for (const auto& device : devices)
      if (!device.usable) std::cout << "unusable " << device.name << ": " << device.reason << std::endl;
    std::cout << "opened " << palpate::compute::open_device(argc > 1 ? argv[1] : "").info().index << "\n";
    return 0;
  } catch (const palpate::core::Error& error) {
    std::cerr << error.what() << "\n";
    return error.exit_code();
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
