// surfeit verify: every checksum and invariant of a scene file.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "surfeit/scene.h"
#include "tools/command.h"
#include "tools/console.h"

namespace surfeit {
namespace {

Status runVerify(const std::string& path, CommandContext& context) {
  SURFEIT_ASSIGN_OR_RETURN(
      const VerifyReport report,
      verifyScene(path, context.threads(), context.progress(), context.common.memory_bytes));
  SURFEIT_RETURN_IF_ERROR(context.writeStats({{"command", "verify"},
                                              {"pages", report.pages_checked},
                                              {"bytes", report.bytes_checked},
                                              {"finding_count", report.finding_count},
                                              {"findings", report.findings}}));
  if (report.finding_count == 0) {
    context.answer(fmt::format("{}: sound: {} pages, {} in {:.1f} s", path,
                               formatCount(report.pages_checked), formatBytes(report.bytes_checked),
                               context.wallSeconds()));
    return {};
  }
  // All findings but the last; the last is the command's error
  for (std::size_t i = 0; i + 1 < report.findings.size(); ++i) {
    tell(fmt::format("surfeit: {}\n", report.findings[i]));
  }
  if (report.finding_count > report.findings.size()) {
    tell(fmt::format("surfeit: {}: {} more findings\n", path,
                     report.finding_count - report.findings.size()));
  }
  return Status::corruption(report.findings.back());
}

}  // namespace

void addVerifyCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("verify", "Check every byte of a scene file");
  const auto path = std::make_shared<std::string>();
  command->add_option("SCENE", *path, "Scene file (.sft)")->required();
  context.addCommonOptions(*command);
  command->footer(
      "Exit status 3 and a line for each finding when something is wrong.\n"
      "Examples:\n"
      "  surfeit verify lion.sft\n"
      "  surfeit verify city.sft --memory 96M --threads 8");
  command->callback([path, &context] { context.run([&] { return runVerify(*path, context); }); });
}

}  // namespace surfeit
