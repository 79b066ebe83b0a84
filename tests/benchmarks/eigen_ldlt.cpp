// Eigen's SimplicialLDLT (AMD ordering, lower triangle) on a matrix written by eigen_ldlt.py. CPU seconds to stdout.
#include <Eigen/Sparse>
#include <cstdint>
#include <ctime>
#include <fstream>
#include <iostream>
#include <vector>

template <class T> std::vector<T> block(std::ifstream& in, int64_t count) {
    std::vector<T> values(count);
    in.read(reinterpret_cast<char*>(values.data()), count * sizeof(T));
    return values;
}

int main(int, char** argv) {
    std::ifstream in(argv[1], std::ios::binary);
    const auto size = block<int64_t>(in, 2);  // unknowns, entries of the lower triangle by columns
    const auto pointer = block<int32_t>(in, size[0] + 1);
    const auto row = block<int32_t>(in, size[1]);
    const auto value = block<double>(in, size[1]);
    const auto load = block<double>(in, size[0]);
    Eigen::SparseMatrix<double> K = Eigen::Map<const Eigen::SparseMatrix<double>>(
        size[0], size[0], size[1], pointer.data(), row.data(), value.data());
    Eigen::Map<const Eigen::VectorXd> b(load.data(), size[0]);
    const auto start = std::clock();
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver;
    solver.compute(K);
    const auto factored = std::clock();
    const Eigen::VectorXd x = solver.solve(b);
    const auto solved = std::clock();
    const Eigen::VectorXd left = K.selfadjointView<Eigen::Lower>() * x - b;
    std::cout << double(factored - start) / CLOCKS_PER_SEC << " " << double(solved - factored) / CLOCKS_PER_SEC << " "
              << left.norm() / b.norm() << std::endl;
    return solver.info() == Eigen::Success ? 0 : 1;
}
