// The program: one subcommand a file, parsed by CLI11.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "surfeit/version.h"
#include "tools/command.h"
#include "tools/console.h"
#include "tools/renderman_words.h"
#include "tools/suggestion.h"

namespace surfeit {
namespace {

void addCommands(CLI::App& app, CommandContext& context) {
  addSampleCommand(app, context);
  addGenerateCommand(app, context);
  addConvertCommand(app, context);
  addIndexCommand(app, context);
  addInfoCommand(app, context);
  addVerifyCommand(app, context);
  addNormalsCommand(app, context);
  addGatherCommand(app, context);
  addMergeCommand(app, context);
  addRadianceCommand(app, context);
  addRelightCommand(app, context);
  addBounceCommand(app, context);
  addBrickCommand(app, context);
  addTuneCommand(app, context);
  addPlanCommand(app, context);
  addViewCommand(app, context);
  addCompositeCommand(app, context);
  addCubeCommand(app, context);
  addPtfilterCommand(app, context);
  addBrickmakeCommand(app, context);
  addLookupCommand(app, context);
}

// --help and --version.
int answerHelp(const CLI::App& app, const CLI::Success& success) {
  std::ostringstream text;
  const int exit_status = app.exit(success, text, text);
  const Status written = writeAnswer(text.str());
  if (written.ok()) return exit_status;
  tell("surfeit: " + written.message() + "\n");
  return exitStatus(written.code());
}

int parseAndRun(const std::vector<std::string>& words, CommandContext& context) {
  context.words = words;
  CLI::App app("Surfeit: gathers over huge surfel clouds inside a memory budget", "surfeit");
  app.set_version_flag("--version", std::string("surfeit ") + kVersion);
  app.require_subcommand(1);
  app.get_formatter()->column_width(36);
  addCommands(app, context);
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::Success& success) {
    return answerHelp(app, success);
  } catch (const CLI::ParseError& error) {
    tell(std::string("surfeit: ") + error.what() + suggestOption(app, words) + "\n");
    context.exit_status = exitStatus(StatusCode::kInvalidArgument);
  }
  return context.exit_status;
}

// A command, or a command once for each frame of its sequence.
int runWords(const std::vector<std::string>& words) {
  CommandContext context;
  const int exit_status = parseAndRun(words, context);
  if (!context.isSequence()) return exit_status;
  KeptScene kept;
  return runSequence(context.sequence.frames, context.common.quiet,
                     [&](const SequenceFrame& frame) {
                       CommandContext of_frame(frame);
                       of_frame.kept_scene = &kept;
                       parseAndRun(words, of_frame);
                       return of_frame.frameOutcome();
                     });
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::prepareStreams();
  // Few arenas, and large buffers given back when freed: the memory budget counts what is in use
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  return surfeit::runWords(surfeit::wordsOf(argc, argv));
}
