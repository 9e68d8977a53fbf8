//! The `gyrogen` binary.

fn main() -> std::process::ExitCode {
    gyrogen::cli::main()
}
