using System;

namespace Gsac
{
    public enum GsacSortKernel
    {
        Blocks,
        Across,
        Merge,
    }

    /// <summary>One dispatch of the bitonic network in Gsac.compute.</summary>
    public struct GsacSortStep
    {
        public GsacSortKernel Kernel;
        public int Stage;
        public int Shift;
        public int Strides;
        public int Groups;
    }

    /// <summary>Sizes and steps of the sort for a number of gaussians.</summary>
    public sealed class GsacSort
    {
        /// <summary>Keys that a group sorts in shared memory; BLOCK of Gsac.compute.</summary>
        public const int Block = 1 << BlockBits;
        const int BlockBits = 12;
        const int AcrossThreads = 64;
        const int Hand = 16; // keys of a thread, four steps

        public readonly int KeyCount = Block;
        public readonly int IndexBits = 1;
        public readonly GsacSortStep[] Steps;

        public GsacSort(int count)
        {
            int merges = 0;
            while (KeyCount < count)
            {
                KeyCount *= 2;
                merges++;
            }
            while (IndexBits < 31 && 1 << IndexBits < count) IndexBits++;
            int steps = 1;
            for (int m = 1; m <= merges; m++) steps += 1 + (m + 3) / 4;
            Steps = new GsacSortStep[steps];
            int n = 0;
            Steps[n++] = new GsacSortStep { Kernel = GsacSortKernel.Blocks, Groups = KeyCount / Block };
            // merge number m has m steps across blocks
            for (int m = 1; m <= merges; m++)
            {
                int stage = Block << m;
                for (int left = m; left > 0; left -= 4)
                {
                    Steps[n++] = new GsacSortStep
                    {
                        Kernel = GsacSortKernel.Across, Stage = stage, Shift = BlockBits + left - 4,
                        Strides = Hand - 1 ^ (Hand - 1 >> Math.Min(left, 4)), Groups = KeyCount / Hand / AcrossThreads,
                    };
                }
                Steps[n++] = new GsacSortStep { Kernel = GsacSortKernel.Merge, Stage = stage, Groups = KeyCount / Block };
            }
        }
    }
}
