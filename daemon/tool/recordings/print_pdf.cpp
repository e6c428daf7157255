#include "daemon/tool/recordings/print_pdf.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

namespace vibrig::tool {

namespace fs = std::filesystem;

void print_pdf(const std::string& html, const std::string& pdf) {
    char folder[] = "/tmp/vibrig-print.XXXXXX";
    if (::mkdtemp(folder) == nullptr) throw std::runtime_error("/tmp: no temporary folder");
    const std::string profile = std::string("--user-data-dir=") + folder;
    const std::string to = "--print-to-pdf=" + fs::absolute(pdf).string();
    const std::string from = "file://" + fs::absolute(html).string();
    const pid_t child = ::fork();
    if (child == 0) {
        if (std::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(127);
        for (const char* name : {"chromium", "chromium-browser", "google-chrome"})
            ::execlp(name, name, "--headless", "--no-sandbox", "--disable-gpu",
                     "--no-pdf-header-footer", profile.c_str(), to.c_str(), from.c_str(), nullptr);
        ::_exit(127);
    }
    int status = -1;
    ::waitpid(child, &status, 0);
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    // The file may be there already, empty.
    const auto size = fs::file_size(pdf, ignored);
    const bool printed = !ignored && size > 0;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || !printed)
        throw std::runtime_error(pdf + (WIFEXITED(status) && WEXITSTATUS(status) == 127
                                            ? ": found no chromium, expected it to print"
                                            : ": chromium could not print it"));
}

}  // namespace vibrig::tool
