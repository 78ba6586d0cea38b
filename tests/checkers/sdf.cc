// Reads SDF files with the reference library, each from its own folder; every error is printed and ends in exit code 1.
#include <filesystem>
#include <iostream>
#include <string>

#include <sdf/sdf.hh>

int main(int count, char **files) {
  int bad = 0;
  for (int i = 1; i < count; ++i) {
    const auto folder = std::filesystem::absolute(files[i]).parent_path().string();
    sdf::setFindCallback([folder](const std::string &name) { return folder + "/" + name; });
    std::filesystem::current_path(folder);
    sdf::Root root;
    for (const auto &error : root.Load(folder + "/" + std::filesystem::path(files[i]).filename().string())) {
      std::cout << files[i] << ": " << error.Message() << "\n";
      bad = 1;
    }
  }
  return bad;
}
