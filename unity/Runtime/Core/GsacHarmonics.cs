using System;

namespace Gsac
{
    /// <summary>
    /// Light that falls on a diffuse surface, by its normal: of each channel a polynomial of the second order, which is all that such
    /// a surface shows of distant light (Ramamoorthi and Hanrahan 2001). Linear, as a factor of the surface's colour.
    /// </summary>
    public sealed class GsacHarmonics
    {
        const int Terms = 10; // 1; x, y, z; xx, yy, zz, xy, yz, zx
        readonly double[] terms = new double[3 * Terms];
        readonly double[] turned = new double[3 * Terms];

        public void Clear()
        {
            Array.Clear(terms, 0, terms.Length);
        }

        /// <summary>Adds the nine numbers of Unity's ambient probe: of 1; y, z, x; xy, yz, 3 zz - 1, zx, xx - yy.</summary>
        public void AddProbe(int channel, float one, float y, float z, float x, float xy, float yz, float zz, float zx, float rest)
        {
            int c = channel * Terms;
            terms[c] += one - zz;
            terms[c + 1] += x;
            terms[c + 2] += y;
            terms[c + 3] += z;
            terms[c + 4] += rest;
            terms[c + 5] -= rest;
            terms[c + 6] += 3 * zz;
            terms[c + 7] += xy;
            terms[c + 8] += yz;
            terms[c + 9] += zx;
        }

        /// <summary>Adds light from one direction (x, y, z to where it comes from, unit), as bright as `strength` on what faces it.</summary>
        public void AddSun(int channel, float strength, float x, float y, float z)
        {
            // max(0, cos) in the second order: 1/4 + cos/2 + 5/32 (3 cos^2 - 1)
            int c = channel * Terms;
            double square = strength * 15 / 32.0;
            terms[c] += strength * (1 / 4.0 - 5 / 32.0);
            terms[c + 1] += strength * x / 2;
            terms[c + 2] += strength * y / 2;
            terms[c + 3] += strength * z / 2;
            terms[c + 4] += square * x * x;
            terms[c + 5] += square * y * y;
            terms[c + 6] += square * z * z;
            terms[c + 7] += square * 2 * x * y;
            terms[c + 8] += square * 2 * y * z;
            terms[c + 9] += square * 2 * z * x;
        }

        /// <summary>
        /// Fills seven rows as Gsac.compute takes them, of normals m n instead of n. m: 3 x 3, row by row, orthonormal; rows: 28.
        /// </summary>
        public void Rows(float[] m, float share, float[] rows)
        {
            for (int channel = 0; channel < 3; channel++)
            {
                Turn(m, channel * Terms);
                int c = channel * Terms, one = channel * 4, two = 12 + channel * 4;
                // unit normals: xx + yy is 1 - zz
                double flat = (turned[c + 4] + turned[c + 5]) / 2;
                for (int i = 0; i < 3; i++) rows[one + i] = (float)turned[c + 1 + i];
                rows[one + 3] = (float)(turned[c] + flat);
                rows[two] = (float)turned[c + 7];
                rows[two + 1] = (float)turned[c + 8];
                rows[two + 2] = (float)(turned[c + 6] - flat);
                rows[two + 3] = (float)turned[c + 9];
                rows[24 + channel] = (float)((turned[c + 4] - turned[c + 5]) / 2);
            }
            rows[27] = share;
        }

        void Turn(float[] m, int c)
        {
            turned[c] = terms[c];
            for (int i = 0; i < 3; i++) turned[c + 1 + i] = m[i] * terms[c + 1] + m[3 + i] * terms[c + 2] + m[6 + i] * terms[c + 3];
            for (int i = 0; i < 3; i++)
            {
                turned[c + 4 + i] = Square(m, c, i, i);
                turned[c + 7 + i] = 2 * Square(m, c, i, (i + 1) % 3);
            }
        }

        /// <summary>Number i, j of the transposed m times the symmetric matrix of the second order times m.</summary>
        double Square(float[] m, int c, int i, int j)
        {
            double sum = 0;
            for (int a = 0; a < 3; a++)
            {
                int b = (a + 1) % 3;
                sum += terms[c + 4 + a] * m[a * 3 + i] * m[a * 3 + j]
                    + terms[c + 7 + a] / 2 * (m[a * 3 + i] * m[b * 3 + j] + m[b * 3 + i] * m[a * 3 + j]);
            }
            return sum;
        }
    }
}
