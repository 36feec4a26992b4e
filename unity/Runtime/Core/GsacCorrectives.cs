using System;

namespace Gsac
{
    /// <summary>
    /// What turned joints add to the vertices at rest beside skinning. A joint's rotation against its parent, less the identity, row
    /// by row, moves a vertex by three rows of nine numbers.
    /// </summary>
    public sealed class GsacCorrectives
    {
        public int[] Start;   // V + 1: those of vertex v are rows Start[v] .. Start[v + 1] - 1
        public int[] Joint;   // C
        public float[] Delta; // C x 3 x 9, m

        /// <summary>A joint's rotation, x y z w, as the nine numbers of it in `turns`, J x 12.</summary>
        public static void SetTurn(float[] turns, int joint, float x, float y, float z, float w)
        {
            int o = joint * 12;
            turns[o] = -2 * (y * y + z * z);
            turns[o + 1] = 2 * (x * y - w * z);
            turns[o + 2] = 2 * (x * z + w * y);
            turns[o + 3] = 2 * (x * y + w * z);
            turns[o + 4] = -2 * (x * x + z * z);
            turns[o + 5] = 2 * (y * z - w * x);
            turns[o + 6] = 2 * (x * z - w * y);
            turns[o + 7] = 2 * (y * z + w * x);
            turns[o + 8] = -2 * (x * x + y * y);
        }

        /// <summary>m: how far a vertex can be moved at most, whatever the pose.</summary>
        public float Reach(int vertex)
        {
            double sum = 0;
            for (int i = Start[vertex]; i < Start[vertex + 1]; i++)
            {
                double squares = 0;
                for (int c = i * 27; c < i * 27 + 27; c++) squares += (double)Delta[c] * Delta[c];
                sum += Math.Sqrt(8 * squares); // a rotation less the identity has at most the norm of half a turn
            }
            return (float)sum;
        }

        /// <summary>To axes in which x has the other sign, and back.</summary>
        public void Mirror()
        {
            for (int i = 0; i < Delta.Length; i++)
            {
                int axis = i / 9 % 3, row = i / 3 % 3, column = i % 3;
                bool turned = (axis == 0) ^ (row == 0) ^ (column == 0);
                if (turned) Delta[i] = -Delta[i];
            }
        }
    }
}
