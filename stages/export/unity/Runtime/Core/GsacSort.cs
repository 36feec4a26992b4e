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
        public int Stride;
        public int Groups;
    }

    /// <summary>Sizes and steps of the sort for a number of gaussians.</summary>
    public sealed class GsacSort
    {
        /// <summary>Keys that a group sorts in shared memory; BLOCK and THREADS of Gsac.compute.</summary>
        public const int Block = 4096;
        const int Threads = 256;

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
            // merge number m is preceded by m steps across blocks
            Steps = new GsacSortStep[1 + merges + merges * (merges + 1) / 2];
            int n = 0;
            Steps[n++] = Step(GsacSortKernel.Blocks, Block, 0);
            for (int stage = 2 * Block; stage <= KeyCount; stage *= 2)
            {
                for (int stride = stage / 2; stride >= Block; stride /= 2) Steps[n++] = Step(GsacSortKernel.Across, stage, stride);
                Steps[n++] = Step(GsacSortKernel.Merge, stage, 0);
            }
        }

        GsacSortStep Step(GsacSortKernel kernel, int stage, int stride)
        {
            int groups = kernel == GsacSortKernel.Across ? KeyCount / 2 / Threads : KeyCount / Block;
            return new GsacSortStep { Kernel = kernel, Stage = stage, Stride = stride, Groups = groups };
        }
    }
}
