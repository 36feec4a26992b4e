using UnityEngine;
using UnityEngine.Animations;
using UnityEngine.Playables;

namespace Gsac.Samples
{
    /// <summary>Blends two Humanoid clips on a person, without an Animator Controller: of the file, or any that moves a Humanoid.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Mecanim")]
    public sealed class GsacMecanim : MonoBehaviour
    {
        [SerializeField] GsacCast cast = null;
        [SerializeField] AnimationClip first = null;
        [SerializeField] AnimationClip second = null;
        [SerializeField, Range(0, 1), Tooltip("0 shows the first clip, 1 the second.")] float blend = 0;

        PlayableGraph graph;
        AnimationMixerPlayable mixer;

        public float Blend
        {
            get { return blend; }
            set { blend = value; }
        }

        void Start()
        {
            if (cast == null || cast.First == null || first == null || second == null)
            {
                Debug.LogWarning(name + ": drag two Humanoid clips onto the fields First and Second", this);
                return;
            }
            cast.First.Source = GsacSource.Animator;
            graph = PlayableGraph.Create("Gsac Mecanim");
            mixer = AnimationMixerPlayable.Create(graph, 2);
            graph.Connect(AnimationClipPlayable.Create(graph, first), 0, mixer, 0);
            graph.Connect(AnimationClipPlayable.Create(graph, second), 0, mixer, 1);
            AnimationPlayableOutput.Create(graph, "Body", cast.First.GetComponent<Animator>()).SetSourcePlayable(mixer);
            graph.Play();
        }

        void Update()
        {
            if (!graph.IsValid()) return;
            mixer.SetInputWeight(0, 1 - blend);
            mixer.SetInputWeight(1, blend);
        }

        void OnDestroy()
        {
            if (graph.IsValid()) graph.Destroy();
        }
    }
}
