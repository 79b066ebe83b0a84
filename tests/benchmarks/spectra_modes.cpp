// Spectra's shift-invert Lanczos on matrices written by spectra_modes.py, over its own SparseLU ("own") or over Eigen's
// Cholesky ("cholesky"). CPU seconds and seconds by the clock, then eigenvalues and residuals, to stdout.
#include <Eigen/Sparse>
#include <Spectra/MatOp/SparseSymShiftSolve.h>
#include <Spectra/SymEigsShiftSolver.h>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

template <class T> std::vector<T> block(std::ifstream& in, int64_t count) {
    std::vector<T> values(count);
    in.read(reinterpret_cast<char*>(values.data()), count * sizeof(T));
    return values;
}

// Spectra's own operator factorises with SparseLU: this one uses the faster Cholesky, as a careful user might.
struct ShiftSolve {
    using Scalar = double;
    const Eigen::SparseMatrix<double>& A;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver;
    Eigen::Index rows() const { return A.rows(); }
    Eigen::Index cols() const { return A.cols(); }
    void set_shift(double sigma) {
        Eigen::SparseMatrix<double> I(A.rows(), A.rows());
        I.setIdentity();
        solver.compute(A - sigma * I);
    }
    void perform_op(const double* in, double* out) const {
        Eigen::Map<Eigen::VectorXd>(out, rows()) = solver.solve(Eigen::Map<const Eigen::VectorXd>(in, rows()));
    }
};

template <class Operator> int solved(Operator& op, const Eigen::SparseMatrix<double>& A, int count, double shift) {
    const auto start = std::clock();
    const auto clock = std::chrono::steady_clock::now();
    Spectra::SymEigsShiftSolver<Operator> eigen(op, count, 2 * count + 1, shift);
    eigen.init();
    eigen.compute(Spectra::SortRule::LargestMagn, 1000, 1e-10);
    std::cout.precision(12);
    const Eigen::VectorXd values = eigen.eigenvalues();
    const Eigen::MatrixXd vectors = eigen.eigenvectors();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - clock;
    std::cout << double(std::clock() - start) / CLOCKS_PER_SEC << " " << seconds.count();
    for (Eigen::Index i = 0; i < values.size(); ++i) {
        const Eigen::VectorXd y = vectors.col(i);
        const Eigen::VectorXd off = A.selfadjointView<Eigen::Lower>() * y - values(i) * y;
        std::cout << " " << values(i) << " " << off.norm() / y.norm();
    }
    std::cout << std::endl;
    return eigen.info() == Spectra::CompInfo::Successful ? 0 : 1;
}

int main(int, char** argv) {
    const int count = std::atoi(argv[2]);
    const double shift = std::atof(argv[3]);
    std::ifstream in(argv[1], std::ios::binary);
    const auto size = block<int64_t>(in, 2);  // unknowns, entries of the lower triangle by columns
    const auto pointer = block<int32_t>(in, size[0] + 1);
    const auto row = block<int32_t>(in, size[1]);
    const auto value = block<double>(in, size[1]);
    Eigen::SparseMatrix<double> A = Eigen::Map<const Eigen::SparseMatrix<double>>(
        size[0], size[0], size[1], pointer.data(), row.data(), value.data());
    if (std::string(argv[4]) == "cholesky") {
        ShiftSolve op{A, {}};
        return solved(op, A, count, shift);
    }
    Spectra::SparseSymShiftSolve<double, Eigen::Lower> op(A);
    return solved(op, A, count, shift);
}
